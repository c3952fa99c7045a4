"""Outlines of zones as hands draw them: closed where they cross themselves, and tails cut."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import shapely

from sketchmatch.model import FloatArray

__all__ = ["mended"]

# What is cut encloses at most this share of what stays: more is an outline that crosses itself.
_SMALL = 0.05
# A hand leaves few crossings in few points; an outline that has more is not looked at.
_MOST_CROSSINGS = 64
_MOST_POINTS = 20_000
_AT_ONCE = 64


def mended(ring: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return an outline without the tails and loops that a hand leaves where it closes one.

    Of both ways round from a crossing the one that encloses next to nothing is cut. An outline
    without crossings stays as it is, and so does one that crosses itself otherwise.

    Parameters
    ----------
    ring
        Shape (k, 2), the first point not repeated.

    Returns
    -------
    FloatArray, FloatArray
        The outline, and which given point each of its points is, or comes after: numbers that have
        a fraction at crossings.
    """
    as_given = ring, np.arange(len(ring), dtype=np.float64)
    if len(ring) > _MOST_POINTS or shapely.Polygon(ring).is_valid:
        return as_given
    (points, numbers), cut = as_given, list[tuple[float, float]]()
    for a, b, place in _crossings(ring):
        if any(low < end < high for low, high in cut for end in (a, b)):
            continue
        within, before, after = (numbers > a) & (numbers < b), numbers < a, numbers > b
        inner = np.vstack([place, points[within]])
        outer = np.vstack([points[before], place, points[after]])
        small, large = sorted((_enclosed(inner), _enclosed(outer)))
        if not large or small > _SMALL * large:
            return as_given
        if _enclosed(inner) == large:
            points, numbers = inner, np.concatenate([[a], numbers[within]])
            cut += [(-math.inf, a), (b, math.inf)]
        else:
            points, numbers = outer, np.concatenate([numbers[before], [a], numbers[after]])
            cut.append((a, b))
    return points, numbers


def _crossings(ring: FloatArray) -> list[tuple[float, float, FloatArray]]:
    """Return both numbers of each place where an outline comes twice, and the place.

    That from which one way round has the fewest points comes first; there are none if there are
    too many.
    """
    count, ends = len(ring), np.roll(ring, -1, axis=0)
    lines: Any = shapely.linestrings(np.stack([ring, ends], axis=1))
    tree, found = shapely.STRtree(lines), list[tuple[float, float, FloatArray]]()
    for first in range(0, count, _AT_ONCE):
        some, others = tree.query(lines[first : first + _AT_ONCE], predicate="intersects")
        apart = others - some - first
        chosen = (apart > 1) & (apart < count - 1)
        if len(found) + chosen.sum() > _MOST_CROSSINGS:
            return []
        for i, j in zip((some + first)[chosen].tolist(), others[chosen].tolist(), strict=True):
            common = shapely.get_coordinates(shapely.intersection(lines[i], lines[j]))
            if not len(common):  # a point that is repeated makes a line of no length
                continue
            place = common[0]
            a, b = (k + lines[k].project(shapely.Point(place), normalized=True) for k in (i, j))
            found.append((a, b, place))
    return sorted(found, key=lambda each: min(each[1] - each[0], count - each[1] + each[0]))


def _enclosed(points: FloatArray) -> float:
    """Return the area of all that a closed line goes around."""
    if len(points) < 3:
        return 0.0
    line = shapely.union_all([shapely.LinearRing(points)])
    return float(shapely.area(shapely.polygonize(shapely.get_parts(line))))
