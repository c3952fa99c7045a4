"""Cutting work into slices: nothing lost, nothing twice, no slice too slow."""

from types import SimpleNamespace

import pytest

from sketchmatch.pipeline import slices as module
from sketchmatch.pipeline.slices import finish, slices


@pytest.mark.parametrize("total", [0, 1, 2, 9, 1000, 100_000])
def test_slices_are_a_partition(total):
    ranges = list(slices(total))
    assert [k for first, last in ranges for k in range(first, last)] == list(range(total))
    assert all(first < last for first, last in ranges)


def test_they_grow_while_the_work_is_quick_and_shrink_when_it_is_not(monkeypatch):
    clock = [0.0]
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    sizes = []
    for first, last in slices(2000):
        sizes.append(last - first)
        clock[0] += (last - first) * (1e-4 if first < 1000 else 1e-2)
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
