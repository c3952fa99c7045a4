"""Cutting work into slices: nothing lost, nothing twice, no slice too slow."""

import threading
import time
from types import SimpleNamespace

import pytest

from sketchmatch.pipeline import slices as module
from sketchmatch.pipeline.slices import finish, in_slices


@pytest.fixture(params=[1, 2, 7], ids="{} cpus".format)
def cpus(request, monkeypatch):
    monkeypatch.setattr(module, "_usable_cpus", lambda: request.param)
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
    if total == 100:
        assert len(names - {threading.main_thread().name}) == (0 if cpus == 1 else min(cpus, 4))
    assert not pool_threads()


@pytest.mark.usefixtures("cpus")
def test_short_work_starts_no_thread():
    names = set()
    list(in_slices(50, lambda *_: names.add(threading.current_thread().name)))
    assert names == {threading.main_thread().name}


@pytest.mark.usefixtures("quick_to_pool", "cpus")
def test_what_the_work_raises_comes_out_and_nothing_goes_on():
    def work(first, last):
        time.sleep(0.001)
        if first >= 20:
            raise ZeroDivisionError(f"at {last}")

    with pytest.raises(ZeroDivisionError):
        list(in_slices(10_000, work))
    assert not pool_threads()


@pytest.mark.usefixtures("quick_to_pool")
def test_closing_waits_for_what_is_under_way_and_starts_nothing(cpus):
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
    assert sorted(begun) == sorted(ended)
    assert len(begun) <= before + cpus
    after = len(begun)
    time.sleep(0.02)
    assert len(begun) == after
    assert not pool_threads()


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
    monkeypatch.setattr(module, "_usable_cpus", lambda: 1)
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
