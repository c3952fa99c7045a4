"""Ctrl-C that gets lost.

What it raises is ignored where Python is called from C or in a finaliser.
"""

from __future__ import annotations

import signal
from collections.abc import Iterable

__all__ = ["check", "listen", "settle"]

_came: list[int] = []


def listen() -> None:
    """Remember each Ctrl-C from now on, beside what Python makes of it."""
    _came.clear()
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _remember)


def check(*_: object) -> Iterable[None]:
    """Interrupt where somebody wanted it and it got lost; to be called now and then.

    Raises
    ------
    KeyboardInterrupt
        If there was a Ctrl-C.
    """
    if _came:
        raise KeyboardInterrupt
    return ()


def settle() -> None:
    """Let the process end with its own exit code, after whatever was interrupted.

    Python ends by the signal itself if the last string that it executed, as libraries do with code
    that they write, was interrupted, even where that was caught long ago.
    """
    exec("")


def _remember(number: int, _frame: object) -> None:
    _came.append(number)
    raise KeyboardInterrupt
