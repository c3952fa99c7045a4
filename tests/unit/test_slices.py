"""Cutting work into slices: nothing lost, nothing twice, no slice too slow."""

import gc
import os
import signal
import threading
import time
from types import SimpleNamespace

import pytest

from sketchmatch.pipeline import slices as module
from sketchmatch.pipeline.slices import finish, in_slices


@pytest.fixture(params=[1, 2, 7], ids="{} cpus".format)
def cpus(request, monkeypatch):
    monkeypatch.setattr(module, "usable_cpus", lambda: request.param)
    return request.param


@pytest.fixture
def quick_to_pool(monkeypatch):
    """Make a slice 2 ms, so that little work is worth a pool."""
    monkeypatch.setattr(module, "_SLICE_SECONDS", 0.002)


def pool_threads():
    return [
        thread for thread in threading.enumerate() if thread.name.startswith("sketchmatch-slice")
    ]


@pytest.mark.usefixtures("quick_to_pool")
@pytest.mark.parametrize("total", [0, 1, 2, 9, 100])
def test_every_item_is_done_once_and_the_share_rises_to_one(cpus, total):
    done, names = [], set()

    def work(first, last):
        time.sleep(0.0005 * (last - first))
        done.extend(range(first, last))
        names.add(threading.current_thread().name)

    shares = list(in_slices(total, work))
    assert sorted(done) == list(range(total))
    assert shares == sorted(shares)
    assert shares[-1:] == ([1.0] if total else [])
    assert len(names - {threading.main_thread().name}) <= (0 if cpus == 1 else 4)
    assert len(pool_threads()) <= 4, "the same threads do everybody's work"


@pytest.mark.usefixtures("quick_to_pool")
def test_as_many_ranges_as_there_are_processors_are_done_at_once_and_four_at_most(cpus):
    there, wanted = set(), min(cpus, 4)
    all_there = threading.Event()

    def work(first, last):
        time.sleep(0.001 * (last - first))
        if module._is_helping():
            there.add(first)
            if len(there) == wanted:
                all_there.set()
            assert all_there.wait(20)

    list(in_slices(200, work))
    assert all_there.is_set() == (cpus > 1)


@pytest.mark.usefixtures("cpus")
def test_short_work_starts_no_thread():
    names = set()
    list(in_slices(50, lambda *_: names.add(threading.current_thread().name)))
    assert names == {threading.main_thread().name}


@pytest.mark.usefixtures("quick_to_pool", "cpus")
def test_what_the_work_raises_comes_out_and_nothing_goes_on():
    begun = []

    def work(first, last):
        time.sleep(0.001)
        if first >= 20:
            raise ZeroDivisionError(f"at {last}")

        begun.append(first)

    with pytest.raises(ZeroDivisionError):
        list(in_slices(10_000, work))
    time.sleep(0.02)
    before = len(begun)
    time.sleep(0.02)
    assert len(begun) == before


@pytest.mark.usefixtures("quick_to_pool")
def test_closing_starts_nothing_and_lets_what_is_under_way_end(cpus):
    begun, ended = [], []

    def work(first, last):
        begun.append(first)
        time.sleep(0.001 * (last - first))
        ended.append(first)

    shares = in_slices(10_000, work)
    while next(shares) < 0.01:
        pass
    before = len(begun)
    shares.close()
    time.sleep(0.02)
    assert sorted(begun) == sorted(ended)
    assert len(begun) <= before + cpus
    after = len(begun)
    time.sleep(0.02)
    assert len(begun) == after


@pytest.mark.slow
@pytest.mark.usefixtures("quick_to_pool")
def test_what_is_forgotten_may_be_collected_in_a_thread_of_its_own_work(monkeypatch):
    monkeypatch.setattr(module, "usable_cpus", lambda: 2)
    forgotten, collected, ended = [], threading.Event(), threading.Event()

    def work(first, last):
        begins_late = bool(forgotten) and module._is_helping()
        time.sleep(0.001 * (last - first))
        if begins_late:
            collected.wait(10)
            forgotten.clear()
            gc.collect()
            ended.set()

    shares = in_slices(10_000, work)
    while next(shares) < 0.01:
        pass
    forgotten.append(shares)
    next(shares)
    del shares
    collected.set()
    assert ended.wait(10), "the collection waits for work that waits for the collection"
    assert list(in_slices(3, lambda *_: time.sleep(0.002)))[-1] == 1.0


@pytest.mark.usefixtures("quick_to_pool")
def test_work_that_is_itself_cut_into_slices_ends(monkeypatch):
    monkeypatch.setattr(module, "usable_cpus", lambda: 4)
    done = []

    def inner(first, last):
        time.sleep(0.001 * (last - first))
        done.extend(range(first, last))

    def outer(first, last):
        for _ in range(first, last):
            list(in_slices(20, inner))

    list(in_slices(20, outer))
    assert len(done) == 400


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.usefixtures("quick_to_pool")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_forked_process_has_threads_of_its_own(monkeypatch):
    monkeypatch.setattr(module, "usable_cpus", lambda: 2)
    list(in_slices(50, lambda *_: time.sleep(0.001)))
    child = os.fork()
    if child == 0:
        list(in_slices(50, lambda *_: time.sleep(0.001)))
        os._exit(7)
    deadline = time.monotonic() + 20
    while not (ended := os.waitpid(child, os.WNOHANG))[0] and time.monotonic() < deadline:
        time.sleep(0.01)
    if not ended[0]:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(ended[1]) == 7


@pytest.mark.usefixtures("quick_to_pool", "cpus")
def test_while_nobody_asks_no_new_range_starts():
    begun = []

    def work(first, last):
        begun.append(first)
        time.sleep(0.001 * (last - first))

    shares = in_slices(10_000, work)
    while next(shares) < 0.01:
        pass
    time.sleep(0.02)
    before = len(begun)
    time.sleep(0.02)
    assert len(begun) == before
    shares.close()


def test_they_grow_while_the_work_is_quick_and_shrink_when_it_is_not(monkeypatch):
    clock = [0.0]
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    monkeypatch.setattr(module, "usable_cpus", lambda: 1)
    sizes = []

    def work(first, last):
        sizes.append(last - first)
        clock[0] += (last - first) * (1e-4 if first < 1000 else 1e-2)

    finish(in_slices(2000, work))
    assert sizes[:4] == [1, 8, 64, 200], "20 ms at 0.1 ms an item"
    assert sizes[-2] == 2, "20 ms at 10 ms an item"


def test_finish_runs_to_the_end_and_returns_what_comes_out():
    def work():
        seen = []
        for k in range(3):
            seen.append(k)
            yield k / 3
        return seen

    assert finish(work()) == [0, 1, 2]
