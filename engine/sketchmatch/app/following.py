"""Reading what is told of work, in the event loop, while it goes on."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncGenerator
from typing import TypeVar

from sketchmatch.app.tasks import Log

__all__ = ["followed"]

_Item = TypeVar("_Item")


async def followed(log: Log[_Item], seen: int = 0) -> AsyncGenerator[tuple[int, _Item], None]:
    """Yield what a log holds and gets after a number, until it ends; raise what it ends with."""
    loop, changed = asyncio.get_running_loop(), asyncio.Event()

    here = threading.get_ident()

    def wake() -> None:
        if threading.get_ident() == here:
            changed.set()
        else:
            loop.call_soon_threadsafe(changed.set)

    with log.waking(wake):
        while True:
            changed.clear()
            ended, found = log.ended, log.next(seen)
            if found is not None:
                seen, _ = found
                yield found
            elif ended:
                break
            else:
                await changed.wait()
    log.check()
