"""The best object maps that a search met."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sketchmatch.api.kernels import kernel
from sketchmatch.model import FloatArray, Fmap, IntArray

__all__ = ["Ranking", "empty_ranking", "insert", "ranked_fmaps"]


class Ranking(NamedTuple):
    """Different object maps, the best first, changed in place.

    Attributes
    ----------
    maps, values
        int64, shape (k, N), and shape (k,): the partners of the template objects, and ζ; −1 where
        there is no map yet.
    """

    maps: IntArray
    values: FloatArray


def empty_ranking(size: int, objects: int) -> Ranking:
    """Return a ranking without any maps."""
    return Ranking(np.full((size, objects), -1, dtype=np.int64), np.full(size, -1.0))


def ranked_fmaps(ranking: Ranking, argument_objects: int) -> list[Fmap]:
    """Return the FMAPs that the maps induce, the best first."""
    maps = ranking.maps[ranking.values >= 0.0]
    return [Fmap.from_object_map(partners, argument_objects) for partners in maps]


@kernel
def insert(ranking: Ranking, partners: IntArray, value: float) -> None:
    """Put a map in its place, unless it is worse than all or known."""
    maps, values, objects = ranking.maps, ranking.values, partners.size
    if value <= values[-1]:
        return
    for k in range(values.size):
        same = 0
        while same < objects and maps[k, same] == partners[same]:
            same += 1
        if same == objects:
            return
    place = values.size - 1
    while place > 0 and values[place - 1] < value:
        values[place] = values[place - 1]
        for a in range(objects):
            maps[place, a] = maps[place - 1, a]
        place -= 1
    values[place] = value
    for a in range(objects):
        maps[place, a] = partners[a]
