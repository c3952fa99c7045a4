"""Whether a sketch leaves open who is who, between which maps, and what to ask about it."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from sketchmatch.model import BoolArray, FloatArray, IntArray
from sketchmatch.pipeline.result import Ambiguity

__all__ = ["ambiguity", "information_gains"]

_SHARE = 0.5
"""How likely a map is beside the best, at least, to count as about as likely.

Odds below 3 are "not worth more than a bare mention" (Kass and Raftery, 1995, Bayes Factors,
doi:10.1080/01621459.1995.10476572, section 3.2); at 2, a best map likelier than 2/3 never shares.
"""


def ambiguity(
    maps: IntArray, probabilities: Sequence[float], map_objects: int, shown: int
) -> Ambiguity | None:
    """Return which maps share the probability with the best, or None where none does.

    A map does that is at least half as likely as the best and contradicts each one before it that
    does: an object has another partner in it, or its partner belongs to another object. Maps that
    only leave lines out, or have more of them, say the same of who is who and are no ambiguity.

    Parameters
    ----------
    maps
        Shape (K, N): for each map, the best first and then the next best ones, the mapped object
        of each sketched one, −1 for none.
    probabilities
        Shape (K,), of each map.
    map_objects
        How many objects the map has.
    shown
        How many of the others are alternatives of the result.

    Examples
    --------
    Two maps that exchange the first and the last of three objects, and one that leaves one out.

    >>> maps = np.array([[0, 1, 2], [2, 1, 0], [0, 1, -1]])
    >>> ambiguity(maps, [0.4, 0.35, 0.2], map_objects=3, shown=1)
    Ambiguity(maps=2, alternatives=(0,), deciding_sketch_objects=(0, 2))
    >>> ambiguity(maps, [0.6, 0.1, 0.3], map_objects=3, shown=1) is None
    True
    """
    likely = np.asarray(probabilities, dtype=float)
    if likely[0] <= 0.0:
        return None
    close = np.flatnonzero(likely >= _SHARE * likely[0])
    sharing = close[_contradicting(maps[close], map_objects)].tolist()
    if len(sharing) < 2:
        return None
    gains = information_gains(maps[sharing], likely[sharing])
    # Objects that decide alike differ by rounding alone; the first of them is asked for.
    ranked = sorted(range(len(gains)), key=lambda k: -round(gains[k], 9))
    return Ambiguity(
        len(sharing),
        tuple(k - 1 for k in sharing if 1 <= k <= shown),
        tuple(k for k in ranked if gains[k] > 0.0),
    )


def information_gains(maps: IntArray, probabilities: FloatArray) -> list[float]:
    """Return what it tells about which of some maps is right to know the partner of an object.

    That is the expected reduction of the entropy over these maps, in nats; as the partner follows
    from the map, it is the entropy of the partner.

    Parameters
    ----------
    maps
        Shape (K, N), as in :func:`ambiguity`.
    probabilities
        Shape (K,), of each map, in any unit.

    Returns
    -------
    list of float
        N, at least 0; 0 where all maps have the same partner.

    Examples
    --------
    >>> maps = np.array([[0, 1, 2], [2, 1, 0]])
    >>> information_gains(maps, np.array([0.3, 0.3]))
    [0.6931471805599453, 0.0, 0.6931471805599453]
    """
    total = math.fsum(probabilities)
    gains = []
    for partners in maps.T.tolist():
        parts: dict[int, list[float]] = defaultdict(list)
        for partner, probability in zip(partners, probabilities.tolist(), strict=True):
            parts[partner].append(probability)
        shares = [math.fsum(part) / total for part in parts.values()]
        gains.append(0.0 - math.fsum(share * math.log(share) for share in shares))
    return gains


def _contradicting(maps: IntArray, map_objects: int) -> list[int]:
    """Return which maps contradict each of these before them, by index; the first one does."""
    holders = np.full((len(maps), map_objects), -1, dtype=np.int64)
    rows, objects = np.nonzero(maps >= 0)
    holders[rows, maps[rows, objects]] = objects
    kept: list[int] = []
    for k in range(len(maps)):
        if (_disagree(maps[kept], maps[k]) | _disagree(holders[kept], holders[k])).all():
            kept.append(k)
    return kept


def _disagree(others: IntArray, one: IntArray) -> BoolArray:
    """Return which maps have another partner for an object that has one in this map, too."""
    return np.asarray(((others != one) & (others >= 0) & (one >= 0)).any(axis=1))
