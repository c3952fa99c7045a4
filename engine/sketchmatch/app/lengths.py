"""Which requests are likely to take long, by what became of others of their size."""

from __future__ import annotations

from sketchmatch.app.orders import Order

__all__ = ["Lengths"]

_LARGE_BYTES = 1 << 14
"""Polygons of 8 objects have about 2 KB, those of 100 on both sides 26 KB."""
_STEP = 0.25
_LIKELY = 0.5


class Lengths:
    """What is known of how long requests take: of each kind and size, the share that took long.

    Sizes are told apart by powers of two of their bytes, and what happened lately counts most:
    three of the other sort change what is expected. Of a size that never came the large are
    expected to take long.

    Examples
    --------
    >>> lengths, order = Lengths(), Order("m1", "MatchRequest", bytes(2_000))
    >>> lengths.is_long(order)
    False
    >>> lengths.learn(order, long=True)
    >>> lengths.is_long(order)
    True
    """

    def __init__(self) -> None:
        self._shares: dict[tuple[str, int], float] = {}

    def is_long(self, order: Order) -> bool:
        """Whether a request is likely to take long."""
        share = self._shares.get(_sort(order))
        return len(order.data) > _LARGE_BYTES if share is None else share > _LIKELY

    def learn(self, order: Order, *, long: bool) -> None:
        """Hear whether a request took long."""
        sort, seen = _sort(order), float(long)
        share = self._shares.get(sort, seen)
        self._shares[sort] = share + _STEP * (seen - share)


def _sort(order: Order) -> tuple[str, int]:
    return order.kind, len(order.data).bit_length()
