"""Areas on their way from annotations to polygons, and what had to be left out of them."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np
import shapely

from sketchmatch.api import InvalidInputError, Reason
from sketchmatch.model import FloatArray, IntArray, LabelledPolygon, PolygonSet
from sketchmatch.model.limits import check_objects, check_pixels, check_vertices, source_limits

__all__ = [
    "Areas",
    "area_within",
    "box",
    "check_elements",
    "ellipse",
    "runs_area",
    "unfolded",
    "within_reach",
]

_CORNERS = 64
_FAR = 1e15
# How far a simplified outline may leave the stairs of its pixels: pixels, or a share of its size.
_STAIRS, _STAIRS_SHARE = 0.75, 0.02
# Share of an area in other parts that nobody misses.
_SPECK = 0.01
# An outline may cross itself this often, and be looked at in so many pieces at once.
_MOST_CROSSINGS, _PIECES = 10_000, 32
# Vertices for which one element, or run of pixels, is allowed, and runs that one mask may have.
_VERTICES_OF_ELEMENT, _MOST_RUNS = 10, 10_000


class Areas:
    """The objects of a file, in its order, and what was left out."""

    def __init__(self) -> None:
        self._found: list[tuple[shapely.Polygon, str]] = []
        self._left_out: Counter[str] = Counter()
        self._parts = 0
        self._runs = self._pixels = 0

    def __len__(self) -> int:
        return len(self._found)

    def add(self, area: Any, label: str) -> None:
        """Take an area as one object: its largest part, if it has several."""
        parts = [part for part in _polygons(area) if part.area > 0.0]
        if not parts:
            self.leave_out("shapes without area")
            return
        largest = max(parts, key=lambda part: part.area)
        found = len(self._found) + 1
        check_objects(found, "", f"has {found} objects or more")
        self._parts += largest.area < (1.0 - _SPECK) * sum(part.area for part in parts)
        self._found.append((largest, label))

    def of_runs(self, runs: IntArray, field: str, *, columns: bool) -> Any:
        """Return the area of pixels given as runs along rows or columns: line, begin and end.

        Raises
        ------
        InvalidInputError
            If these, with all before, have too many.
        """
        merged = _merged(runs)
        if len(merged) > _MOST_RUNS:
            raise InvalidInputError(
                Reason.LIMIT_EXCEEDED,
                field,
                f"is a mask of {len(merged)} runs of pixels, more than the limit of {_MOST_RUNS}; "
                "smooth it, or save it as a polygon",
            )
        self._runs += len(merged)
        check_vertices(
            _VERTICES_OF_ELEMENT * self._runs,
            field,
            f"and those before have {self._runs} runs",
        )
        return runs_area(merged, columns=columns)

    def check_pixels(self, width: int, height: int, field: str) -> None:
        """Refuse a mask, before it is unpacked, that with all before has too many pixels."""
        check_pixels(width, height, field)
        self._pixels += width * height
        limit = source_limits().max_pixels
        if self._pixels > limit:
            raise InvalidInputError(
                Reason.LIMIT_EXCEEDED,
                field,
                f"and those before have {self._pixels} pixels, more than the limit of {limit}; "
                "save them as polygons, or raise limits.max_pixels "
                "(SKETCHMATCH_LIMITS__MAX_PIXELS)",
            )

    def leave_out(self, what: str, count: int = 1) -> None:
        """Count what is no object, by what it is in the plural."""
        self._left_out[what] += count

    def polygon_set(self, *notes: str, upwards: float = -1.0) -> PolygonSet:
        """Return the objects, y turned up, with notes on what is missing."""
        if self._left_out:
            counts = ", ".join(f"{what} ({count})" for what, count in self._left_out.items())
            notes = (*notes, f"Left out because they enclose no area or are not objects: {counts}.")
        if self._parts:
            notes = (
                *notes,
                f"Objects of which only the largest of several parts was taken: {self._parts}.",
            )
        return PolygonSet(
            tuple(LabelledPolygon(_rings(area, upwards), label) for area, label in self._found),
            notes,
        )


def within_reach(points: Any) -> FloatArray:
    """Return points as an array, if geometry can be done with them: GEOS crashes where it is vast.

    Raises
    ------
    InvalidInputError
        If they are too far away.
    """
    array = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    if not (np.abs(array) <= _FAR).all():
        raise InvalidInputError(
            Reason.INVALID_POLYGON, "", f"reaches beyond ±{_FAR:g}; use a larger unit"
        )
    return array


def area_within(points: Any) -> Any:
    """Return the area within a ring of points, which may cross itself; empty if there is none."""
    ring = within_reach(points)
    if len(ring) < 3:
        return shapely.Polygon()
    area = shapely.Polygon(ring)
    if area.is_valid:
        return area
    _check_crossings(ring)
    return shapely.make_valid(area)


def _check_crossings(ring: FloatArray) -> None:
    """Refuse a ring that crosses itself so often that its area would take minutes and gigabytes."""
    sides: Any = shapely.linestrings(np.stack([ring, np.roll(ring, -1, axis=0)], axis=1))
    tree, crossings = shapely.STRtree(sides), 0
    for k in range(0, len(sides), _PIECES):
        piece = sides[k : k + _PIECES]
        # Each side meets itself and its neighbours.
        crossings += tree.query(piece, predicate="intersects").shape[1] - 3 * len(piece)
        if crossings > 2 * _MOST_CROSSINGS:
            raise InvalidInputError(
                Reason.INVALID_POLYGON,
                "",
                f"has an outline of {len(ring)} points that crosses itself more than "
                f"{_MOST_CROSSINGS} times; draw it again",
            )


def box(x0: float, y0: float, x1: float, y1: float, turn: float = 0.0) -> FloatArray:
    """Return the corners of a box, turned about its middle by radians."""
    corners = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], dtype=np.float64)
    return _turned(corners, turn)


def ellipse(x: float, y: float, rx: float, ry: float, turn: float = 0.0) -> FloatArray:
    """Return points of an ellipse about (x, y), turned by radians."""
    angles = np.linspace(0.0, 2.0 * math.pi, _CORNERS, endpoint=False)
    return _turned(np.column_stack([x + rx * np.cos(angles), y + ry * np.sin(angles)]), turn)


def check_elements(count: int, field: str, what: str) -> None:
    """Refuse more elements than a file of the allowed vertices may have, before work is done."""
    check_vertices(_VERTICES_OF_ELEMENT * count, field, f"has {count} {what}, each of ten vertices")


def runs_area(runs: IntArray, *, columns: bool) -> Any:
    """Return the area of pixels given as runs: the row, or column, and where it begins and ends.

    Where a run has a fourth number, it is of all lines up to that one.
    """
    lines, begins, ends, *more = np.asarray(runs, dtype=np.float64).T
    after = more[0] if more else lines + 1.0
    within_reach(np.column_stack([lines, begins, after, ends]))
    boxes = (
        shapely.box(lines, begins, after, ends)
        if columns
        else shapely.box(begins, lines, ends, after)
    )
    area = shapely.union_all(boxes)
    if area.is_empty:
        return area
    x0, y0, x1, y1 = area.bounds
    return shapely.simplify(area, min(_STAIRS, _STAIRS_SHARE * max(x1 - x0, y1 - y0)))


def unfolded(counts: list[int], length: int) -> IntArray:
    """Return the set runs of pixels that are counted along lines: line, begin and end of each.

    Examples
    --------
    >>> unfolded([2, 3, 1], 3).tolist()  # not set, set, not set; three pixels a line
    [[0, 2, 3], [1, 0, 2]]
    """
    bounds = np.cumsum(np.asarray(counts, dtype=np.int64))
    pairs = bounds[: len(bounds) // 2 * 2].reshape(-1, 2)
    starts, ends = pairs[pairs[:, 1] > pairs[:, 0]].T
    first, last = starts // length, (ends - 1) // length
    lines_of = last - first + 1
    check_vertices(int(lines_of.sum()), "", f"has a mask of {lines_of.sum()} runs")
    which = np.repeat(np.arange(len(starts)), lines_of)
    before = np.cumsum(lines_of) - lines_of
    lines = first[which] + np.arange(len(which)) - before[which]
    begins = np.maximum(starts[which] - lines * length, 0)
    until = np.minimum(ends[which] - lines * length, length)
    return np.column_stack([lines, begins, until])


def _merged(runs: IntArray) -> IntArray:
    """Return runs with those made one that begin and end alike on lines next to each other."""
    if len(runs) == 0:
        return np.empty((0, 4), dtype=np.int64)
    lines, begins, ends = runs[np.lexsort((runs[:, 0], runs[:, 2], runs[:, 1]))].T
    new = np.ones(len(lines), dtype=np.bool_)
    new[1:] = (np.diff(begins) != 0) | (np.diff(ends) != 0) | (np.diff(lines) != 1)
    heads = np.flatnonzero(new)
    tails = np.append(heads[1:], len(lines)) - 1
    return np.column_stack([lines[heads], begins[heads], ends[heads], lines[tails] + 1])


def _turned(points: FloatArray, turn: float) -> FloatArray:
    if turn == 0.0:
        return points
    middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
    c, s = math.cos(turn), math.sin(turn)
    turned: FloatArray = middle + (points - middle) @ np.array([[c, s], [-s, c]])
    return turned


def _polygons(area: Any) -> list[shapely.Polygon]:
    parts = shapely.get_parts(area)
    return [part for part in parts if isinstance(part, shapely.Polygon)] + [
        polygon
        for part in parts
        if not isinstance(part, shapely.Polygon) and hasattr(part, "geoms")
        for polygon in _polygons(part)
    ]


def _rings(area: shapely.Polygon, upwards: float) -> tuple[FloatArray, ...]:
    rings = (area.exterior, *area.interiors)
    return tuple(np.asarray(ring.coords)[:-1, :2] * (1.0, upwards) for ring in rings)
