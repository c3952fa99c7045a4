"""Work that is given up when its time is over, whatever it does.

It runs in a thread of its own. A loop in Python is ended by an exception that is raised in that
thread from outside. What waits or computes elsewhere, without holding up the interpreter, is left
behind as a daemon. Where the interpreter itself is held up, so that the thread that waits for it
can do nothing, faulthandler, whose clock needs none, ends the process and shows every stack.
"""

from __future__ import annotations

import ctypes
import faulthandler
import math
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import copy_context
from typing import Any

__all__ = ["HELD_UP", "OverdueError", "in_time", "together"]

HELD_UP = 5.0
"""Seconds beyond its limit after which work that holds up the interpreter is ended."""

_ATTEMPTS = 10
_PAUSE = 0.2
_LOOK = 0.1


class OverdueError(Exception):
    """Work was not done in time.

    Attributes
    ----------
    stack
        Where it was when its time was over.
    ended
        Whether it could be ended, and does not go on by itself.
    """

    def __init__(self, stack: traceback.StackSummary, ended: bool) -> None:
        super().__init__("it was not done in time")
        self.stack = stack
        self.ended = ended


class _TimeIsOver(BaseException):
    """Raised in a thread from outside, to end it."""


class _Worker(threading.Thread):
    """A thread that keeps what its work returns or raises."""

    def __init__(self, work: Callable[[], Any]) -> None:
        super().__init__(name="sketchmatch-check", daemon=True)
        self._context = copy_context()
        self._work = work
        self._value: Any = None
        self._error: BaseException | None = None

    def run(self) -> None:
        try:
            self._value = self._context.run(self._work)
        except BaseException as error:
            self._error = error

    def outcome(self) -> Any:
        if self._error is not None:
            raise self._error
        return self._value


def in_time(work: Callable[[], Any], seconds: float) -> Any:
    """Return what work returns, or raise what it raises.

    Parameters
    ----------
    work
        What to do.
    seconds
        How long it may take.

    Raises
    ------
    OverdueError
        If it takes longer.
    """
    before = _workers()
    worker = _Worker(work)
    with _ended_when_held_up(seconds + HELD_UP):
        try:
            worker.start()
            worker.join(seconds)
        except BaseException:  # an interrupt, or the time limit of a test
            _end(before)
            raise
        if worker.is_alive():
            stack = _stack_of((_workers() - before) or {worker})
            raise OverdueError(stack, _end(before))
    return worker.outcome()


def together(work: Callable[[], Any], count: int) -> list[Any]:
    """Return what work returns in several threads at once, which end with what calls this."""
    workers = [_Worker(work) for _ in range(count)]
    for worker in workers:
        worker.start()
    for worker in workers:
        while worker.is_alive():
            worker.join(_LOOK)  # between two looks this thread can be ended
    return [worker.outcome() for worker in workers]


def _workers() -> set[_Worker]:
    return {thread for thread in threading.enumerate() if isinstance(thread, _Worker)}


def _stack_of(workers: set[_Worker]) -> traceback.StackSummary:
    """Return where the newest of some threads is."""
    newest = max(workers, key=lambda worker: worker.native_id or 0)
    frame = sys._current_frames().get(newest.ident or 0)
    return traceback.extract_stack(frame) if frame else traceback.StackSummary()


def _end(before: set[_Worker]) -> bool:
    """End the threads that were not there before, and return whether that could be done."""
    for _ in range(_ATTEMPTS):
        running = _workers() - before
        if not running:
            return True
        for worker in running:
            ctypes.pythonapi.PyThreadState_SetAsyncExc(
                ctypes.c_ulong(worker.ident or 0), ctypes.py_object(_TimeIsOver)
            )
        next(iter(running)).join(_PAUSE)
    return False


@contextmanager
def _ended_when_held_up(seconds: float) -> Iterator[None]:
    """End the process, and show where every thread is, if the block takes longer."""
    if faulthandler.is_enabled() and sys.platform == "linux":
        whole = math.ceil(seconds)
        with _aborting_pipe(whole) as pipe:
            faulthandler.dump_traceback_later(whole, file=pipe)
            try:
                yield
            finally:
                faulthandler.cancel_dump_traceback_later()
        return
    with suppress(AttributeError, RuntimeError, OSError):  # where there is no standard error
        faulthandler.dump_traceback_later(seconds, exit=True)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()


@contextmanager
def _aborting_pipe(seconds: int) -> Iterator[int]:
    """Yield a file that aborts the process once faulthandler writes its first line into it.

    Whoever enabled faulthandler, as pytest does, shows the stacks then. What faulthandler writes
    to standard error by itself is lost where that is captured. There is room for the first line
    alone: a second signal would end the process before the stacks are shown.
    """
    import fcntl

    first_line = f"Timeout ({seconds // 3600}:{seconds // 60 % 60:02}:{seconds % 60:02})!\n"
    reading, writing = os.pipe()
    try:
        size = fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, 4096)
        os.set_blocking(writing, False)
        os.write(writing, bytes(size - len(first_line)))
        fcntl.fcntl(reading, fcntl.F_SETOWN, os.getpid())
        fcntl.fcntl(reading, fcntl.F_SETSIG, signal.SIGABRT)
        fcntl.fcntl(reading, fcntl.F_SETFL, os.O_ASYNC | os.O_NONBLOCK)
        yield writing
    finally:
        os.close(reading)
        os.close(writing)
