"""Handing events from a worker thread to a stream that may be slower."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Callable
from typing import Generic, TypeVar

__all__ = ["Mailbox"]

_Item = TypeVar("_Item")


class Mailbox(Generic[_Item]):
    """A queue in which a newer item replaces the last one where both may be replaced.

    Parameters
    ----------
    replaceable
        Whether an item, still waiting, may give way to the next replaceable one.
    """

    def __init__(self, replaceable: Callable[[_Item], bool]) -> None:
        self._replaceable = replaceable
        self._items: deque[_Item] = deque()
        self._changed = asyncio.Event()
        self._closed = False
        self._loop = asyncio.get_running_loop()

    def put(self, item: _Item) -> None:
        """Add an item, from any thread."""
        self._loop.call_soon_threadsafe(self._put, item)

    def close(self) -> None:
        """End the iteration after the items that wait, from any thread."""
        self._loop.call_soon_threadsafe(self._close)

    async def __aiter__(self) -> AsyncIterator[_Item]:
        while True:
            while self._items:
                yield self._items.popleft()
            if self._closed:
                return
            self._changed.clear()
            await self._changed.wait()

    def _put(self, item: _Item) -> None:
        if self._items and self._replaceable(item) and self._replaceable(self._items[-1]):
            self._items.pop()
        self._items.append(item)
        self._changed.set()

    def _close(self) -> None:
        self._closed = True
        self._changed.set()
