"""Furniture of which a scan shows legs alone: which small parts stand together, and not by chance.

A laser sees a table as four legs. Parts at the corners of a rectangle, two bars that face each
other, and a crowd of parts are one thing if so many would not come to stand like this by chance:
of all such sets that one would expect, were the parts strewn over the room at random, there must be
fewer than one [1]_. So the same rule finds chairs in a clean map and none in speckle.

References
----------
.. [1] A. Desolneux, L. Moisan, J.-M. Morel, "Meaningful alignments", International Journal of
   Computer Vision 40(1), 2000.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from sketchmatch.model import FloatArray, IntArray
from sketchmatch_builtin.segmenters._merging import groups

__all__ = ["FOOT", "Bars", "Legs", "chairs", "crowds", "facing", "tables"]

# Sets of parts that chance may make in a room.
_BY_CHANCE = 0.3
# Metres: how well a rectangle's corners are known, and the sides of the narrowest thing on four
# legs and of the longest.
_SLACK = 0.1
_CORNERS = 4
_NARROWEST, _LONGEST = 0.25, 2.0
# A part is a bar from this ratio of its sides on; two bars are alike up to these bounds.
_BAR = 2.5
_ALIKE, _PARALLEL = 0.75, math.cos(math.radians(12.0))
# Metres: longer bars are no feet but two sides of one thing, this near each other.
_SLIT = 0.3
# Two legs of a chair are no farther from each other, and from the table at which it stands.
_SEAT, _REACH = 0.6, 0.5
# A crowd has at least so many parts, each so many metres from the next, as legs of chairs are.
_FEWEST, _STEP = 5, 0.6


FOOT = 0.8
"""In metres: a bar on which a table stands is no longer than this."""


class Legs(NamedTuple):
    """Small parts in a room, in metres.

    Attributes
    ----------
    points
        Shape (n, 2), their middles.
    room
        The area over which they are strewn, in square metres.
    """

    points: FloatArray
    room: float

    @property
    def density(self) -> float:
        """Parts a square metre."""
        return len(self.points) / self.room


class Bars(NamedTuple):
    """Parts as the bars they are most like, in metres.

    Attributes
    ----------
    middles, along
        Shape (n, 2), the middle, and the unit vector of the longer side.
    lengths, widths
        Shape (n,).
    """

    middles: FloatArray
    along: FloatArray
    lengths: FloatArray
    widths: FloatArray


def tables(legs: Legs) -> Iterator[IntArray]:
    """Yield four parts each that stand at the corners of a rectangle.

    No part is in two of them.
    """
    if len(legs.points) < _CORNERS:
        return
    largest = min(_LONGEST * math.sqrt(2.0), _largest_rectangle(legs))
    yield from _apart(_rectangles(legs.points, largest), len(legs.points))


def _largest_rectangle(legs: Legs) -> float:
    """Return up to which diagonal chance makes too few rectangles to count.

    With N parts of density ρ and the slack τ, chance makes N · ρπD² diagonals up to D, ρπDτ third
    corners to each and ρπτ² fourth ones; each rectangle is counted eight times.
    """
    return float(np.cbrt(8.0 * _BY_CHANCE / len(legs.points))) / (math.pi * legs.density * _SLACK)


def _rectangles(points: FloatArray, largest: float) -> IntArray:
    """Return the corners of rectangles, shape (k, 4), from the shortest diagonal on."""
    spots = _points(points)
    i, j = shapely.STRtree(spots).query(spots, predicate="dwithin", distance=largest)
    i, j = i[i < j], j[i < j]
    middles = (points[i] + points[j]) / 2.0
    lengths = np.linalg.norm(points[i] - points[j], axis=1)
    there = _points(middles)
    a, b = shapely.STRtree(there).query(there, predicate="dwithin", distance=_SLACK)
    a, b = a[a < b], b[a < b]
    first, second = (points[i[a]] - points[i[b]]), (points[i[a]] - points[j[b]])
    sides = np.sort(np.linalg.norm([first, second], axis=2), axis=0)
    fits = (np.abs(lengths[a] - lengths[b]) <= _SLACK) & (i[a] != i[b]) & (j[a] != j[b])
    fits &= (i[a] != j[b]) & (j[a] != i[b]) & (sides[0] >= _NARROWEST) & (sides[1] <= _LONGEST)
    corners = np.stack([i[a], j[a], i[b], j[b]], axis=1)[fits]
    return np.asarray(corners[np.argsort((lengths[a] + lengths[b])[fits], kind="stable")])


def _apart(corners: IntArray, count: int) -> Iterator[IntArray]:
    """Yield rectangles that share no part, small ones first.

    Between things in a row there are rectangles too, which may be smaller. So a row is looked at
    from its ends, if that leaves no part over: these parts have only one small rectangle.
    """
    pairs = np.concatenate([corners[:, [0, k]] for k in range(1, _CORNERS)]).T
    group = groups(count, pairs)
    for k in np.unique(group[corners[:, 0]]).tolist():
        together = corners[group[corners[:, 0]] == k]
        from_ends = _taken(together, max)
        leaves_none = _CORNERS * len(from_ends) == np.count_nonzero(group == k)
        yield from from_ends if leaves_none else _taken(together, min)


def _taken(corners: IntArray, which: Callable[[IntArray], int]) -> list[IntArray]:
    """Return rectangles that share no part: of the smallest ones of each part, always this one."""
    taken: list[IntArray] = []
    while len(corners):
        smallest = np.unique(corners, return_index=True)[1] // _CORNERS
        taken.append(corners[which(smallest)])
        corners = corners[~np.isin(corners, taken[-1]).any(axis=1)]
    return taken


def chairs(legs: Legs, hulls: NDArray[np.object_]) -> Iterator[tuple[int, IntArray]]:
    """Yield two parts each that are the outer legs of a chair at a table, and at which one it is.

    The inner ones are next to the table's legs, and one with them. Two parts near a table mean
    nothing if there are as many elsewhere: what is left of the room tells how many are strewn.
    """
    spots, table = _points(legs.points), np.full(len(legs.points), -1)
    near, nearest = shapely.STRtree(hulls).query_nearest(
        spots, max_distance=_REACH, all_matches=False
    )
    table[near] = nearest
    around = shapely.area(shapely.buffer(hulls, _REACH)) - shapely.area(hulls)
    density = np.count_nonzero(table < 0) / max(legs.room - around.sum(), around.sum())
    by_chance = around * density**2 * math.pi * (_SEAT**2 - _NARROWEST**2) / 2.0
    i, j = shapely.STRtree(spots).query(spots, predicate="dwithin", distance=_SEAT)
    fits = (i < j) & (table[i] == table[j]) & (table[i] >= 0)
    i, j = i[fits], j[fits]
    fits = np.hypot(*(legs.points[i] - legs.points[j]).T) >= _NARROWEST
    fits &= by_chance[table[i]] < _BY_CHANCE
    for k in np.flatnonzero(fits).tolist():
        yield int(table[i[k]]), np.array([i[k], j[k]])


def facing(bars: Bars) -> Iterator[IntArray]:
    """Yield pairs of bars that are alike and face each other, the nearest ones first.

    Feet stand up to a table's length apart, the two long sides of one thing a slit.
    """
    long = np.flatnonzero(bars.lengths >= _BAR * bars.widths)
    taken = np.zeros(len(bars.lengths), dtype=bool)
    spots = _points(bars.middles[long])
    if not len(long):
        return
    i, j = shapely.STRtree(spots).query(spots, predicate="dwithin", distance=_LONGEST)
    i, j = long[i[i < j]], long[j[i < j]]
    between = bars.middles[j] - bars.middles[i]
    along = np.abs((between * bars.along[i]).sum(axis=1))
    shorter = np.minimum(bars.lengths[i], bars.lengths[j])
    apart = np.linalg.norm(between, axis=1)
    slit = apart - (bars.widths[i] + bars.widths[j]) / 2.0
    fits = np.abs((bars.along[i] * bars.along[j]).sum(axis=1)) >= _PARALLEL
    fits &= shorter >= _ALIKE * np.maximum(bars.lengths[i], bars.lengths[j])
    fits &= along <= 0.25 * shorter
    fits &= (slit <= _SLIT) | (shorter <= FOOT)
    for k in np.flatnonzero(fits)[np.argsort(apart[fits], kind="stable")].tolist():
        if not taken[[i[k], j[k]]].any():
            taken[[i[k], j[k]]] = True
            yield np.array([i[k], j[k]])


def crowds(legs: Legs) -> Iterator[IntArray]:
    """Yield parts, each near the next, that are too many for chance.

    Of N parts of density ρ, each has k − 1 others in a circle of area A around it with the
    probability of a Poisson variable of mean ρA; N times that must be small.
    """
    if len(legs.points) < _FEWEST or math.pi * _STEP**2 * legs.density > _FEWEST:
        return
    spots = _points(legs.points)
    near = shapely.STRtree(spots).query(spots, predicate="dwithin", distance=_STEP)
    group = groups(len(spots), near)
    for k in np.flatnonzero(np.bincount(group) >= _FEWEST).tolist():
        members = np.flatnonzero(group == k)
        mean = legs.density * _circle(legs.points[members])
        if len(legs.points) * _at_least(len(members) - 1, mean) < _BY_CHANCE:
            yield members


def _points(places: FloatArray) -> NDArray[np.object_]:
    return np.asarray(shapely.points(places), dtype=object)


def _circle(points: NDArray[np.float64]) -> float:
    """Return the area of the smallest circle around one of some points that holds the others."""
    away = np.hypot(*(points[:, None] - points[None]).T)
    return float(math.pi * away.max(axis=1).min() ** 2)


def _at_least(count: int, mean: float) -> float:
    """Return with which probability a Poisson variable is at least so large."""
    term = below = math.exp(-mean)
    for k in range(1, count):
        term *= mean / k
        below += term
    return max(0.0, 1.0 - below)
