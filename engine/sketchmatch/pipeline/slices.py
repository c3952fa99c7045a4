"""Cutting long work into slices, so that it can be watched and stopped."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator
from typing import Any, TypeVar

__all__ = ["finish", "slices"]

_Value = TypeVar("_Value")
_SLICE_SECONDS = 0.02


def slices(total: int) -> Iterator[tuple[int, int]]:
    """Yield consecutive ranges [first, last) of ``total`` items that take about 20 ms each.

    The size follows the time that the consumer took for the range before.
    """
    first, size = 0, 1
    while first < total:
        last = min(total, first + size)
        started = time.monotonic()
        yield first, last
        seconds = max(time.monotonic() - started, 1e-6)
        wanted = int((last - first) * _SLICE_SECONDS / seconds)
        size = max(1, min(wanted, 8 * size))
        first = last


def finish(work: Generator[Any, None, _Value]) -> _Value:
    """Run a generator to its end and return what it returns."""
    while True:
        try:
            next(work)
        except StopIteration as stop:
            return stop.value  # type: ignore[no-any-return]
