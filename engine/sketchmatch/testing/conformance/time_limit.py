"""Work that is given up when its time is over, whatever it does.

It runs in a thread of its own. A loop in Python is ended by an exception that is raised in that
thread from outside. What waits or computes elsewhere, without holding up the interpreter, is left
behind as a daemon. Where the interpreter itself is held up, so that the thread that waits for it
can do nothing, a timer that needs no interpreter ends the process, and faulthandler shows every
stack.
"""

from __future__ import annotations

import ctypes
import faulthandler
import math
import os
import signal
import sys
import threading
import time
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
    """End the process, and show where every thread is, if the block takes longer.

    What faulthandler's own timer writes is lost where standard error is captured. Whoever enabled
    faulthandler, as pytest does, shows the stacks where they are seen when the process is aborted.
    """
    if faulthandler.is_enabled() and sys.platform == "linux":
        with _aborted_after(seconds):
            yield
        return
    with suppress(AttributeError, RuntimeError, OSError):  # where there is no standard error
        faulthandler.dump_traceback_later(seconds, exit=True)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()


class _SignalEvent(ctypes.Structure):
    """What a timer does when it fires: ``struct sigevent``, 64 bytes long."""

    _fields_ = (
        ("value", ctypes.c_void_p),
        ("signal", ctypes.c_int),
        ("notify", ctypes.c_int),  # 0: by that signal
        ("unused", ctypes.c_byte * (64 - ctypes.sizeof(ctypes.c_void_p) - 8)),
    )


class _TimerSpan(ctypes.Structure):
    """``struct itimerspec``."""

    _fields_ = tuple(
        (name, ctypes.c_long) for name in ("interval_s", "interval_ns", "after_s", "after_ns")
    )


@contextmanager
def _aborted_after(seconds: float) -> Iterator[None]:
    """Send the process one SIGABRT, by a timer of the kernel, if the block takes longer.

    A second signal would end it before the first has shown the stacks.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    timer = ctypes.c_void_p()
    event = _SignalEvent(signal=signal.SIGABRT)
    _checked(libc.timer_create(time.CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)))
    try:
        part, whole = math.modf(seconds)
        span = _TimerSpan(after_s=int(whole), after_ns=int(part * 1e9))
        _checked(libc.timer_settime(timer, 0, ctypes.byref(span), None))
        yield
    finally:
        libc.timer_delete(timer)


def _checked(failed: int) -> None:
    if failed:
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code))
