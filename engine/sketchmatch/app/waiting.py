"""Who is next: a queue in which callers take turns."""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable, Iterator
from typing import Generic, NamedTuple, TypeVar

__all__ = ["Caller", "FairQueue"]

_Item = TypeVar("_Item")


class Caller(NamedTuple):
    """Who asks.

    Attributes
    ----------
    name
        The caller's name, or the host where it is.
    connection
        One of its connections.
    known
        The caller's name by token or certificate; empty where nobody asked for any.
    """

    name: str = ""
    connection: str = ""
    known: str = ""


class FairQueue(Generic[_Item]):
    """Items that wait: callers take turns, and so do the connections of each.

    Parameters
    ----------
    priority
        Tells which of a caller's items come first: those for which it is larger.

    Examples
    --------
    >>> queue = FairQueue()
    >>> for item, name in [("a1", "a"), ("a2", "a"), ("a3", "a"), ("b1", "b")]:
    ...     queue.add(item, Caller(name))
    >>> [queue.take() for _ in range(4)]
    ['a1', 'b1', 'a2', 'a3']
    """

    def __init__(self, priority: Callable[[_Item], int] = lambda _: 0) -> None:
        self._priority = priority
        self._lines: OrderedDict[str, OrderedDict[str, deque[_Item]]] = OrderedDict()

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __iter__(self) -> Iterator[_Item]:
        for lines in self._lines.values():
            for line in lines.values():
                yield from line

    def add(self, item: _Item, caller: Caller) -> None:
        """Let an item wait behind those of its connection."""
        lines = self._lines.setdefault(caller.name, OrderedDict())
        lines.setdefault(caller.connection, deque()).append(item)

    def take(self, fits: Callable[[_Item], bool] = lambda _: True) -> _Item | None:
        """Take out the item whose turn it is, of those that fit; None if there is none."""
        for name, lines in self._lines.items():
            best: tuple[_Item, str] | None = None
            for connection, line in lines.items():
                for item in line:
                    first = best is None or self._priority(item) > self._priority(best[0])
                    if first and fits(item):
                        best = item, connection
            if best is not None:
                item, connection = best
                self._lines.move_to_end(name)
                lines.move_to_end(connection)
                self.remove(item, Caller(name, connection))
                return item
        return None

    def remove(self, item: _Item, caller: Caller) -> bool:
        """Take out a certain item; return whether it was there."""
        lines = self._lines.get(caller.name, OrderedDict[str, deque[_Item]]())
        line = lines.get(caller.connection, deque())
        if item not in line:
            return False
        line.remove(item)
        if not line:
            del lines[caller.connection]
        if not lines:
            del self._lines[caller.name]
        return True

    def crowd_out(
        self, newcomer: Caller, size: Callable[[_Item], int] = lambda _: 1
    ) -> tuple[_Item, Caller] | None:
        """Take out the last item of whoever has most, of the least priority there.

        Of those who have as much, the newcomer is crowded out. ``size`` says how much an item is.
        """
        if not self._lines:
            return None

        def much(line: deque[_Item]) -> int:
            return sum(map(size, line))

        def crowd(name: str) -> tuple[int, bool]:
            return sum(map(much, self._lines[name].values())), name == newcomer.name

        name = max(self._lines, key=crowd)
        lines = self._lines[name]

        def length(connection: str) -> tuple[int, bool]:
            return much(lines[connection]), Caller(name, connection) == newcomer

        caller = Caller(name, max(lines, key=length))
        item = min(reversed(lines[caller.connection]), key=self._priority)
        self.remove(item, caller)
        return item, caller
