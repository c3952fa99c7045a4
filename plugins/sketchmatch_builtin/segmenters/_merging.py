"""Parts of one thing, as the legs of a table, joined to one outline."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from sketchmatch.model import IntArray

__all__ = ["apart", "groups", "merged"]

_Geometries = NDArray[np.object_]


def merged(parts: _Geometries, distance: float, largest: float) -> _Geometries:
    """Return one geometry for each group of small parts that are near each other.

    A group is the small parts joined by steps of at most ``distance``; it becomes its convex hull,
    as what connects the legs of a table is above the plane of the scan. Hulls that overlap others
    take these in, so that what comes out is apart. A part alone stays as it is.

    Parameters
    ----------
    parts
        Shape (k,), polygons that do not overlap.
    distance
        In the parts' unit.
    largest
        Area of the largest part that is small.

    Returns
    -------
    ndarray
        Shape (groups,), in the order of each group's first part.
    """
    near = shapely.STRtree(parts).query(parts, predicate="dwithin", distance=distance)
    small = shapely.area(parts) <= largest
    return apart(parts, groups(len(parts), near[:, small[near].all(axis=0)]))[0]


def apart(parts: _Geometries, group: IntArray) -> tuple[_Geometries, IntArray]:
    """Return the hulls of groups of parts, and each part's group after those that overlap are one.

    Parameters
    ----------
    parts
        Shape (k,), polygons.
    group
        Shape (k,), the number of each part's group, counted from 0 in the order of first parts.
    """
    while True:
        hulls = _hulls(parts, group)
        overlapping = shapely.STRtree(hulls).query(hulls, predicate="intersects")
        joined = groups(len(hulls), overlapping)
        if joined.max(initial=-1) + 1 == len(hulls):
            return hulls, group
        group = joined[group]


def _hulls(parts: _Geometries, group: IntArray) -> _Geometries:
    order = np.argsort(group, kind="stable")
    starts = np.flatnonzero(np.diff(group[order], prepend=-1))
    hulls: _Geometries = np.empty(len(starts), dtype=object)
    for k, members in enumerate(np.split(order, starts[1:])):
        alone = len(members) == 1
        hulls[k] = parts[members[0]] if alone else _hull(parts[members])
    return hulls


def _hull(parts: _Geometries) -> shapely.Geometry:
    return shapely.GeometryCollection(list(parts)).convex_hull


def groups(count: int, pairs: IntArray) -> IntArray:
    """Return the number of each item's group, in the order of the groups' first items.

    Parameters
    ----------
    count
        Number of items.
    pairs
        Shape (2, k), items that belong together.
    """
    a, b = np.concatenate([pairs, pairs[::-1]], axis=1)
    first = np.arange(count)
    while True:
        before = first.copy()
        np.minimum.at(first, a, before[b])
        first = first[first]
        if (first == before).all():
            return np.asarray(np.unique(first, return_inverse=True)[1])
