"""Pen strokes out of what tools export in their place: the outline of their ink, filled.

Excalidraw, tldraw and note-taking apps save what a pen drew as a thin ribbon with its two sides,
vector editors do so on *Stroke to Path*, and tracing a scan gives nothing else. The line that was
drawn lies in the middle of the ribbon.
"""

from __future__ import annotations

import math
from functools import reduce
from typing import Any

import numpy as np
import shapely

from sketchmatch.io._svg_curves import signed_area
from sketchmatch.model import FloatArray

__all__ = ["pen_lines"]

# A ribbon is at most this wide, as a share of its length.
_WIDEST = 1 / 8
# One that leads elsewhere than to its beginning has this many corners or curves: with fewer it is a
# bar that was drawn.
_CORNERS = 16
# A loop's ends are at most this share of its size apart, and joined enclose as much of its area.
_GAP, _ROUND = 0.5, 0.3
# Of the places along a ribbon this share is no wider than this many times its mean.
_MOST, _FAR = 0.9, 3.0
# A ring of ink is a line around something if its width is at most this share of its extent.
_WIDEST_RING = 0.25
# From so many holes on, or if all is so many times as long as around it, it is walls of rooms.
_FEWEST_ROOMS, _WINDING = 3, 2.5
# … or if less of it is rings: a pen's ends are shorter.
_ALL_BUT_ENDS = 0.75
# Where ends are looked for first, places compared for that, and how often the search is refined.
_STARTS, _PLACES, _ROUNDS = 96, 24, 8
_FEWEST, _MOST_POINTS = 48, 1000
# Rings of one shape that are put into each other; of more, each is an outline of its own.
_MOST_RINGS = 2000
# A ring that crosses itself more often is an outline of its own, too; so many sides are looked at
# together.
_MOST_CROSSINGS, _AT_ONCE = 300, 64


def pen_lines(rings: list[FloatArray], corners: list[int], evenodd: bool) -> list[list[FloatArray]]:
    """Return what was drawn of what the subpaths of one filled shape enclose.

    Parameters
    ----------
    rings
        The subpaths, each closed, shape (k, 2), first point repeated.
    corners
        Of how many curves and lines each is made.
    evenodd
        Whether the fill rule is that, not ``nonzero``.

    Returns
    -------
    list of list of ndarray
        For each ribbon the line in its middle, for a ring of ink the lines in its middle, for all
        else its outline; nothing for holes.
    """
    inked, holes = _nested(rings, evenodd)
    lines: list[list[FloatArray]] = [[] for _ in rings]
    others = []
    for k in inked:
        middle = None if holes[k] else _middle(rings[k], corners[k])
        if middle is None:
            others.append(k)
        else:
            lines[k] = [middle]
    for k, outlines in zip(others, _outlines(rings, others, holes), strict=True):
        lines[k] = outlines
    return lines


def _middle(ring: FloatArray, corners: int) -> FloatArray | None:
    """Return the line in the middle of a ribbon from end to end, or None if it is no ribbon."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(ring, axis=0).T))])
    half, area = way[-1] / 2.0, abs(signed_area(ring))
    if not 0.0 < 4.0 * area < half**2:
        return None
    width = (half - math.sqrt(half**2 - 4.0 * area)) / 2.0
    long = half - width
    if width > _WIDEST * long:
        return None
    sides = _sides(ring, way)
    if (np.hypot(*(sides[0] - sides[1]).T) < _FAR * width).mean() < _MOST:
        return None
    middle = (sides[0] + sides[1]) / 2.0
    size = float(np.ptp(middle, axis=0).max())
    enclosed = abs(signed_area(middle))
    if math.dist(middle[0], middle[-1]) <= _GAP * size and enclosed > _ROUND * area:
        return middle
    return middle if corners >= _CORNERS else None


def _sides(ring: FloatArray, way: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return points opposite each other on the two sides of a ribbon, each of shape (k, 2).

    Its ends are where the two sides between them, walked at paces such that both take as long,
    stay nearest to each other.
    """
    first, second = np.meshgrid(np.arange(_STARTS), np.arange(_STARTS), indexing="ij")
    apart = second - first
    able = (apart >= _STARTS // 4) & (apart <= 3 * _STARTS // 4)
    starts, ends = first[able] / _STARTS, second[able] / _STARTS
    step = 0.5 / _STARTS
    for _ in range(_ROUNDS):
        best = int(np.argmin(_distances(ring, way, starts, ends)))
        near = step * np.arange(-2, 3)
        starts, ends = (starts[best] + near)[:, None], (ends[best] + near)[None, :]
        starts, ends = (each.ravel() for each in np.broadcast_arrays(starts, ends))
        step /= 2.0
    best = int(np.argmin(_distances(ring, way, starts, ends)))
    count = min(max(_FEWEST, len(ring) // 2), _MOST_POINTS)
    share = np.linspace(0.0, 1.0, count)
    there = starts[best] + share * (ends[best] - starts[best])
    back = starts[best] - share * (1.0 - ends[best] + starts[best])
    return _at(ring, way, there), _at(ring, way, back)


def _distances(
    ring: FloatArray, way: FloatArray, starts: FloatArray, ends: FloatArray
) -> FloatArray:
    """Return the mean distance of the two sides between starts and ends."""
    share = (np.arange(_PLACES) + 0.5) / _PLACES
    there = starts[:, None] + share * (ends - starts)[:, None]
    back = starts[:, None] - share * (1.0 - ends + starts)[:, None]
    gaps = _at(ring, way, there) - _at(ring, way, back)
    return np.asarray(np.hypot(gaps[..., 0], gaps[..., 1]).mean(axis=1))


def _at(ring: FloatArray, way: FloatArray, shares: FloatArray) -> FloatArray:
    """Return the points at shares of the way around, shape (…, 2)."""
    along = (shares % 1.0) * way[-1]
    x, y = ring.T
    return np.stack([np.interp(along, way, x), np.interp(along, way, y)], axis=-1)


def _nested(rings: list[FloatArray], evenodd: bool) -> tuple[list[int], dict[int, list[int]]]:
    """Return which rings bound ink from outside, the largest first, and the holes in each."""
    if len(rings) < 2 or len(rings) > _MOST_RINGS:
        return [*range(len(rings))], {k: [] for k in range(len(rings))}
    areas = [signed_area(ring) for ring in rings]
    order = sorted(range(len(rings)), key=lambda k: -abs(areas[k]))
    polygons = [shapely.Polygon(ring) if len(ring) > 3 else shapely.Polygon() for ring in rings]
    tree = shapely.STRtree(polygons)
    rank = {k: r for r, k in enumerate(order)}
    # A ring lies in another one if some points of it do, all around.
    inside = [
        inner * len(rings) + outer
        for inner, outer in (
            tree.query(
                shapely.points([ring[int(share * (len(ring) - 1))] for ring in rings]),
                predicate="within",
            )
            for share in (0.0, 0.25, 0.5, 0.75)
        )
    ]
    around: dict[int, list[int]] = {k: [] for k in order}
    for pair in reduce(np.intersect1d, inside).tolist():
        k, j = divmod(pair, len(rings))
        if rank[j] < rank[k]:
            around[k].append(j)
    winding: dict[int, int] = {}
    holes: dict[int, list[int]] = {k: [] for k in order}
    inked = []
    for k in order:
        parent = max(around[k], key=lambda j: rank[j], default=None)
        outside = winding[parent] if parent is not None else 0
        winding[k] = outside + (1 if evenodd or areas[k] >= 0.0 else -1)
        is_inked, was_inked = (n % 2 != 0 if evenodd else n != 0 for n in (winding[k], outside))
        if is_inked and not was_inked:
            inked.append(k)
        elif was_inked and not is_inked and parent is not None:
            holes[parent].append(k)
    return inked, holes


def _outlines(
    rings: list[FloatArray], which: list[int], holes: dict[int, list[int]]
) -> list[list[FloatArray]]:
    """Return for some rings, each with its holes, the outlines of what they bound."""
    shapes = [
        shapely.Polygon(rings[k], [rings[j] for j in holes[k]] if holes[k] else None) for k in which
    ]
    outlines = [
        _around(shape, rings[k]) if holes[k] else [rings[k]]
        for k, shape in zip(which, shapes, strict=True)
    ]
    plain = [
        n
        for n, k in enumerate(which)
        if shapes[n].is_valid or not any(_is_tangled(rings[j]) for j in (k, *holes[k]))
    ]
    for group in _overlapping([shapes[n] for n in plain]) if len(rings) <= _MOST_RINGS else []:
        first, *others = sorted((plain[k] for k in group), key=lambda n: which[n])
        whole = shapely.union_all([shapely.make_valid(shapes[n]) for n in (first, *others)])
        outlines[first] = [
            line
            for part in shapely.get_parts(whole)
            if isinstance(part, shapely.Polygon)
            for line in _around(part, shapely.get_coordinates(part.exterior))
        ]
        for n in others:
            outlines[n] = []
    return outlines


def _is_tangled(ring: FloatArray) -> bool:
    """Whether a ring crosses itself so often that to find what is within it would take minutes."""
    sides: Any = shapely.linestrings(np.stack([ring[:-1], ring[1:]], axis=1))
    tree, crossings = shapely.STRtree(sides), 0
    for k in range(0, len(sides), _AT_ONCE):
        some = sides[k : k + _AT_ONCE]
        # Each side meets itself and its neighbours, and what it crosses is met from there, too.
        crossings += tree.query(some, predicate="intersects").shape[1] - 3 * len(some)
        if crossings > 2 * _MOST_CROSSINGS:
            return True
    return False


def _overlapping(shapes: list[shapely.Polygon]) -> list[list[int]]:
    """Return the groups of shapes that touch, two or more each, as they look like one."""
    if not shapes:
        return []
    first, second = shapely.STRtree(shapes).query(shapes, predicate="intersects")
    group = list(range(len(shapes)))

    def top(k: int) -> int:
        while group[k] != k:
            group[k] = group[group[k]]
            k = group[k]
        return k

    for k, j in zip(first.tolist(), second.tolist(), strict=True):
        group[top(k)] = top(j)
    groups: dict[int, list[int]] = {}
    for k in range(len(shapes)):
        groups.setdefault(top(k), []).append(k)
    return [each for each in groups.values() if len(each) > 1]


def _around(shape: shapely.Polygon, outline: FloatArray) -> list[FloatArray]:
    """Return the lines in the middle of rings of ink; of another shape with holes its outline.

    Around several holes, or one that winds, or if much of it leads elsewhere, ink is walls: what
    bounds it are its sides.
    """
    outer = shapely.Polygon(shape.exterior)
    width = 2.0 * shape.area / shape.length
    x0, y0, x1, y1 = shape.bounds
    if not shape.interiors or not 0.0 < width <= _WIDEST_RING * min(x1 - x0, y1 - y0):
        return [outline]
    sides = [outline, *map(shapely.get_coordinates, shape.interiors)]
    if len(shape.interiors) >= _FEWEST_ROOMS or shape.length > _WINDING * outer.length:
        return sides
    # Ends of the line that stick out, and lines from ring to ring, are as thin as it is and vanish.
    rings = shapely.buffer(shapely.buffer(outer, -0.75 * width), 0.25 * width)
    parts = [part for part in shapely.get_parts(rings) if part.area > width**2]
    if width * sum(part.exterior.length for part in parts) < _ALL_BUT_ENDS * shape.area:
        return sides
    return [shapely.get_coordinates(part.exterior) for part in parts]
