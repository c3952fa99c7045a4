"""Areas on their way from annotations to polygons, and what had to be left out of them."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np
import shapely

from sketchmatch.api import InvalidInputError, Reason
from sketchmatch.model import FloatArray, LabelledPolygon, PolygonSet

__all__ = ["Areas", "area_within", "box", "ellipse", "runs_area", "unfolded", "within_reach"]

_CORNERS = 64
_FAR = 1e15
# How far a simplified outline may leave the stairs of its pixels: pixels, or a share of its size.
_STAIRS, _STAIRS_SHARE = 0.75, 0.02
# Share of an area in other parts that nobody misses.
_SPECK = 0.01


class Areas:
    """The objects of a file, in its order, and what was left out."""

    def __init__(self) -> None:
        self._found: list[tuple[shapely.Polygon, str]] = []
        self._left_out: Counter[str] = Counter()
        self._parts = 0

    def __len__(self) -> int:
        return len(self._found)

    def add(self, area: Any, label: str) -> None:
        """Take an area as one object: its largest part, if it has several."""
        parts = [part for part in _polygons(area) if part.area > 0.0]
        if not parts:
            self.leave_out("shapes without area")
            return
        largest = max(parts, key=lambda part: part.area)
        self._parts += largest.area < (1.0 - _SPECK) * sum(part.area for part in parts)
        self._found.append((largest, label))

    def leave_out(self, what: str, count: int = 1) -> None:
        """Count what is no object, by what it is in the plural."""
        self._left_out[what] += count

    def polygon_set(self, *notes: str, upwards: float = -1.0) -> PolygonSet:
        """Return the objects, y turned up, with notes on what is missing."""
        if self._left_out:
            counts = ", ".join(f"{what} ({count})" for what, count in self._left_out.items())
            notes = (*notes, f"Left out because they enclose no area or are no objects: {counts}.")
        if self._parts:
            notes = (
                *notes,
                f"Objects in several parts, of which the largest counts: {self._parts}.",
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
    return area if area.is_valid else shapely.make_valid(area)


def box(x0: float, y0: float, x1: float, y1: float, turn: float = 0.0) -> FloatArray:
    """Return the corners of a box, turned about its middle by radians."""
    corners = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], dtype=np.float64)
    return _turned(corners, turn)


def ellipse(x: float, y: float, rx: float, ry: float, turn: float = 0.0) -> FloatArray:
    """Return points of an ellipse about (x, y), turned by radians."""
    angles = np.linspace(0.0, 2.0 * math.pi, _CORNERS, endpoint=False)
    return _turned(np.column_stack([x + rx * np.cos(angles), y + ry * np.sin(angles)]), turn)


def runs_area(runs: list[tuple[int, int, int]], *, columns: bool) -> Any:
    """Return the area of pixels given as runs: the row, or column, and where it begins and ends."""
    lines, begins, ends = np.array(runs, dtype=np.float64).reshape(-1, 3).T
    within_reach(np.column_stack([lines, begins, lines, ends]))
    if columns:
        boxes = shapely.box(lines, begins, lines + 1.0, ends)
    else:
        boxes = shapely.box(begins, lines, ends, lines + 1.0)
    area = shapely.union_all(boxes)
    if area.is_empty:
        return area
    x0, y0, x1, y1 = area.bounds
    return shapely.simplify(area, min(_STAIRS, _STAIRS_SHARE * max(x1 - x0, y1 - y0)))


def unfolded(counts: list[int], length: int) -> list[tuple[int, int, int]]:
    """Return the set runs of pixels that are counted along lines: line, begin and end of each.

    Examples
    --------
    >>> unfolded([2, 3, 1], 3)  # not set, set, not set; three pixels a line
    [(0, 2, 3), (1, 0, 2)]
    """
    runs = []
    ends = np.cumsum(counts).tolist()
    for start, end in zip(ends[::2], ends[1::2], strict=False):
        line, first = divmod(start, length)
        while line * length < end:
            runs.append((line, first, min(end - line * length, length)))
            line, first = line + 1, 0
    return [run for run in runs if run[2] > run[1]]


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
