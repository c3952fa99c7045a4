"""How workers are started: forked from a process that is warm, where forking is sound."""

from __future__ import annotations

import multiprocessing
import multiprocessing.forkserver
import os
import signal
import sys
from contextlib import suppress
from multiprocessing.context import BaseContext

__all__ = ["forking", "prepare", "renew"]

_TEMPLATE = "sketchmatch.app.template"


def forking() -> BaseContext:
    """Return what starts workers."""
    if sys.platform != "linux":
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([_TEMPLATE])
    return context


def prepare() -> None:
    """Begin to load what workers need, beside whatever else a server does when it starts."""
    if forking().get_start_method() == "forkserver":
        multiprocessing.forkserver.ensure_running()


def renew() -> None:
    """Fork workers from a new process from now on, which finds what was compiled meanwhile."""
    server = multiprocessing.forkserver._forkserver
    pid: int | None = getattr(server, "_forkserver_pid", None)
    if pid is not None:
        with suppress(OSError):
            os.kill(pid, signal.SIGKILL)  # it is started anew when it is needed
            if hasattr(os, "waitid"):  # and while it is dying, who needs it is refused
                os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)
