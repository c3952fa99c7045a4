"""A request with a life of its own: what it has told so far, for any number of readers."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Generic, TypeVar

__all__ = ["Log", "Task"]

_Item = TypeVar("_Item")


class Log(Generic[_Item]):
    """What has been told, numbered from 1; items are added and read from any thread.

    Of items that are news alone only the latest is kept, so a slow reader misses old ones; all
    others stay.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._kept: list[tuple[int, _Item]] = []
        self._news: tuple[int, _Item] | None = None
        self._count = 0
        self._ended = False
        self._error: BaseException | None = None
        self._readers: set[Callable[[], None]] = set()

    def add(self, item: _Item, *, news: bool = False) -> None:
        """Add an item; the next one that is news takes the place of one that is."""
        with self._lock:
            self._count += 1
            if news:
                self._news = (self._count, item)
            else:
                self._kept.append((self._count, item))
        self._wake()

    def end(self, error: BaseException | None = None) -> None:
        """Add nothing more; with an error, each reader is told it in the end."""
        with self._lock:
            self._error = error
            self._ended = True
        self._wake()

    def next(self, seen: int) -> tuple[int, _Item] | None:
        """Return the first item that is left of those after number ``seen``; None for none yet."""
        with self._lock:
            waiting = [each for each in (*self._kept, self._news) if each and each[0] > seen]
        return min(waiting, key=lambda each: each[0], default=None)

    @property
    def ended(self) -> bool:
        """Whether there will be no more."""
        return self._ended

    def check(self) -> None:
        """Raise the error that the log ended with, if it did."""
        if self._error is not None:
            raise self._error

    @contextmanager
    def waking(self, reader: Callable[[], None]) -> Iterator[None]:
        """Call a reader, from any thread, whenever something is new."""
        with self._lock:
            self._readers.add(reader)
        try:
            yield
        finally:
            with self._lock:
                self._readers.discard(reader)

    def _wake(self) -> None:
        with self._lock:
            readers = tuple(self._readers)
        for reader in readers:
            reader()


class Task(Generic[_Item]):
    """One request that was admitted.

    Attributes
    ----------
    id
        A name that no other task of the application has.
    caller
        The name of who asked for it; empty where nobody has names.
    log
        Its responses.
    stopping
        Set once nobody wants more of them.
    """

    def __init__(self, name: str, caller: str = "") -> None:
        self.id = name
        self.caller = caller
        self.log = Log[_Item]()
        self.stopping = threading.Event()

    def stop(self) -> None:
        """Ask the task to end; it does at its next step."""
        self.stopping.set()
