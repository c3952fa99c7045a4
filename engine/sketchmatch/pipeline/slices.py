"""Cutting long work into slices, so that it can be watched and stopped."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import closing
from typing import Any, TypeVar

from sketchmatch.pipeline.processors import usable_cpus

__all__ = ["finish", "in_slices", "is_helper", "retold"]

_Step = TypeVar("_Step")
_Told = TypeVar("_Told")
_Value = TypeVar("_Value")
_SLICE_SECONDS = 0.02
_MOST_THREADS = 4
_THREAD_NAME = "sketchmatch-slice"
_pool: ThreadPoolExecutor


def in_slices(total: int, work: Callable[[int, int], None]) -> Generator[float, None, None]:
    """Do ``total`` items of work in threads, a range of items that takes about 20 ms at a time.

    Short work is done in the caller's thread; threads that all such work shares help once a range
    is worth it. Between two values no range is started beyond those under way, one a thread, which
    alone end after the generator is closed.

    Parameters
    ----------
    total
        Number of items.
    work
        Called with consecutive ranges [first, last), from several threads at once. It should
        release the GIL; what it raises ends the generator. What it does for an item must not
        depend on the range that the item comes in.

    Yields
    ------
    float
        The share that is done.
    """
    threads = 1 if _is_helping() else min(usable_cpus(), _MOST_THREADS)
    done, size, seconds = 0, 1, 0.0
    while done < total and (threads == 1 or seconds < _SLICE_SECONDS / 4):
        first, done = done, min(total, done + size)
        seconds = _seconds(work, first, done)
        size = _next_size(done - first, seconds)
        yield done / total
    if done < total:
        yield from _in_threads(done, total, size, work, threads)


def finish(work: Generator[Any, None, _Value]) -> _Value:
    """Run a generator to its end and return what it returns."""
    while True:
        try:
            next(work)
        except StopIteration as stop:
            return stop.value  # type: ignore[no-any-return]


def retold(
    work: Generator[_Step, None, _Value], tell: Callable[[_Step], Iterable[_Told]]
) -> Generator[_Told, None, _Value]:
    """Go on with a generator to its end, yielding what ``tell`` makes of each step instead.

    Closing this one closes it, and so does what ``tell`` raises.

    Examples
    --------
    >>> list(retold(in_slices(1, lambda first, last: None), lambda share: (100 * share,)))
    [100.0]
    """
    with closing(work):
        while True:
            try:
                step = next(work)
            except StopIteration as stop:
                return stop.value  # type: ignore[no-any-return]
            yield from tell(step)


def _in_threads(
    first: int, total: int, size: int, work: Callable[[int, int], None], threads: int
) -> Generator[float, None, None]:
    """Do items ``first`` … ``total`` − 1 of work in the pool of threads."""
    running: dict[Future[float], int] = {}
    done, started, closed = first, first, False

    def begin(first: int, last: int) -> float:
        return 0.0 if closed else _seconds(work, first, last)

    # A generator that nobody closed is closed by the garbage collection, in any thread, which may
    # hold any lock or do a range of this very work: nothing may be waited for on that way.
    try:
        while started < total or running:
            while started < total and len(running) < threads:
                last = min(total, started + size)
                running[_pool.submit(begin, started, last)] = last - started
                started = last
            if done > first:
                yield done / total
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                items = running.pop(future)
                size = _next_size(items, future.result())
                done += items
    finally:
        closed = True
    yield 1.0


def _seconds(work: Callable[[int, int], None], first: int, last: int) -> float:
    """Do a range of work and return how long it took."""
    started = time.monotonic()
    work(first, last)
    return time.monotonic() - started


def _next_size(items: int, seconds: float) -> int:
    """Return how many items take 20 ms, if ``items`` took ``seconds``; at most eightfold."""
    wanted = int(items * _SLICE_SECONDS / max(seconds, 1e-6))
    return max(1, min(wanted, 8 * items))


def _start_pool() -> None:
    """Make the pool that lasts as long as the process; its threads start when they are needed."""
    global _pool  # noqa: PLW0603
    _pool = ThreadPoolExecutor(_MOST_THREADS, _THREAD_NAME)


_start_pool()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_start_pool)


def is_helper(thread: threading.Thread) -> bool:
    """Return whether a thread is one of the pool's, which wait for work between two."""
    return thread.name.startswith(_THREAD_NAME)


def _is_helping() -> bool:
    """Return whether this thread is one of the pool's, which must not wait for the others."""
    return is_helper(threading.current_thread())
