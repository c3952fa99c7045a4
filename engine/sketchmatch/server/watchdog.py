"""Ending a process that no longer answers, so that whoever started it can start another."""

from __future__ import annotations

import asyncio
import faulthandler
import os
import signal
import stat
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from sketchmatch.pipeline.processors import usable_cpus

__all__ = ["HUNG", "watch"]

HUNG = 70
"""Exit code of a process that was ended because it no longer answered."""

_TICK_SECONDS = 0.5
_TURN_SECONDS = 4.0
_STANDARD_ERROR = 2


def watch(patience: float | None) -> Callable[[], None]:
    """Watch the running event loop from a thread until it closes or what is returned is called.

    If the loop does nothing, the process ends with the exit code :data:`HUNG` and says where each
    of its threads is. The time that counts is the watching thread's own: a process that was frozen
    or had no processor for a while is spared. Where one thread keeps all others from running, as an
    endless regular expression does, the system ends the process by SIGPROF after about as long.

    Parameters
    ----------
    patience
        Seconds that the loop may do nothing; None watches nothing.
    """
    over = threading.Event()
    if patience is not None:
        asked = (asyncio.get_running_loop(), over, patience)
        threading.Thread(target=_look, args=asked, name="sketchmatch-watchdog", daemon=True).start()
    return over.set


def _look(loop: asyncio.AbstractEventLoop, over: threading.Event, patience: float) -> None:
    alive, silent = threading.Event(), 0.0
    alive.set()
    with _ended_by_the_system(patience) as put_off:
        put_off()  # what locks up at once is ended, too
        while not over.wait(_TICK_SECONDS):
            put_off()
            if not alive.is_set():
                silent += _TICK_SECONDS
            elif _asks(loop, alive):
                silent = 0.0
            else:
                return
            if silent >= patience:
                _end(silent)


@contextmanager
def _ended_by_the_system(patience: float) -> Iterator[Callable[[], None]]:
    """Have the process ended where no Python runs any more, unless that is put off again and again.

    The time is the processors': a process that is frozen uses none. Threads that compute without
    Python use it too, while this one waits for its turn.
    """
    if not hasattr(faulthandler, "register") or signal.getsignal(signal.SIGPROF) != signal.SIG_DFL:
        yield lambda: None
        return
    seconds = patience + _TURN_SECONDS * usable_cpus()
    faulthandler.register(signal.SIGPROF, chain=True)

    def put_off() -> None:
        signal.setitimer(signal.ITIMER_PROF, seconds)

    try:
        yield put_off
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        faulthandler.unregister(signal.SIGPROF)


def _asks(loop: asyncio.AbstractEventLoop, alive: threading.Event) -> bool:
    """Ask a loop for a sign of life; False if it is closed."""
    alive.clear()
    with suppress(RuntimeError):
        loop.call_soon_threadsafe(alive.set)
        return True
    return False


def _end(silent: float) -> None:
    """End the process without asking anybody: any lock may be held by a thread that hangs."""
    sentence = f"sketchmatch: the server has been stuck for {silent:g} s and ends itself\n"
    with suppress(OSError):
        if stat.S_ISFIFO(os.fstat(_STANDARD_ERROR).st_mode):
            os.set_blocking(_STANDARD_ERROR, False)  # nobody may be reading
        os.write(_STANDARD_ERROR, sentence.encode())
        faulthandler.dump_traceback(_STANDARD_ERROR)
    os._exit(HUNG)
