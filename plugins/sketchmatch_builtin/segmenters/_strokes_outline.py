"""What one line encloses: a stroke that closes by itself, or strokes joined to one line."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from sketchmatch.model import FloatArray, IntArray

from ._strokes_trace import Trace, once

__all__ = ["areas_of", "enclosed_by", "own_gap", "tangled", "total_of"]

# What a crossing closes must be this share of what the joined ends enclose: less is a flourish on
# the way round, not the place where the outline closes.
_MAIN_LOOP = 0.5
# A tail beside the outline's start is at most this share of the stroke, and at most this many
# times as long as the ends are apart: a half circle's arc is π/2 times its chord.
_END = 1.0 / 3.0
_BEND = 1.6
# Shares of a length, and of a squared size, that are nothing but rounding.
_ROUNDING = 1e-9
# Crossings of strokes with themselves that are looked at in one sketch, about 25 µs each; a
# thousand objects drawn by hand have a tenth of them. Where pairs of segments are more than
# _PAIRS, so many of them stand for all.
_MOST_CROSSINGS = 8_000
_PAIRS = 1024


@once
def enclosed_by(stroke: Trace, max_gap: float) -> tuple[shapely.Polygon, ...]:
    """Return the separate areas that a stroke encloses by itself, largest first.

    A stroke that crosses itself near its ends is closed at the crossing and its tails are cut;
    else its ends are joined, if they are no more than ``max_gap`` of its size apart. An open
    stroke, and a line there and back, enclose none.
    """
    line = shapely.LineString(stroke.points)
    areas = [] if line.is_simple and not line.is_ring else areas_of(line)
    if not areas or total_of(areas) < _MAIN_LOOP * total_of(areas_of(_joined(stroke.points))):
        closed = _closed(stroke, max_gap * stroke.size)
        areas = [] if closed is None else areas_of(closed)
    return tuple(areas) if total_of(areas) > _ROUNDING * stroke.size**2 else ()


def tangled(strokes: Sequence[Trace]) -> set[int]:
    """Return which strokes cross themselves too often to look at all; the others are the least."""
    counts = np.array([_crossings(stroke) for stroke in strokes])
    order = np.argsort(counts, kind="stable")
    beyond = np.cumsum(counts[order]) > _MOST_CROSSINGS
    return set(order[beyond].tolist())


@once
def own_gap(stroke: Trace) -> float:
    """Return the length of the gap that closes a stroke; 0 if its ends cross."""
    if not shapely.LineString(stroke.points).is_simple:
        tail = _END * stroke.length
        early, late = _tails(stroke, tail)
        if early.intersects(late):
            return 0.0
    return _gap(stroke.points)


def areas_of(line: shapely.LineString) -> list[shapely.Polygon]:
    """Return the separate areas that a line encloses, largest first."""
    noded = shapely.get_parts(shapely.union_all([line]))
    faces = shapely.get_parts(shapely.polygonize(noded))
    try:
        enclosed = shapely.coverage_union_all(faces)
    except shapely.GEOSException:  # faces overlap where edges all but coincide
        enclosed = shapely.union_all(faces, grid_size=_ROUNDING * max(np.ptp(line.coords, axis=0)))
    return sorted(shapely.get_parts(enclosed), key=lambda area: -area.area)


def total_of(areas: Sequence[shapely.Polygon]) -> float:
    """Return the sum of areas."""
    return sum(area.area for area in areas)


@once
def _crossings(stroke: Trace) -> float:
    """Return about how often a stroke crosses itself."""
    points = stroke.points
    segments = len(points) - 1
    total = segments * (segments - 1) // 2
    if not total:
        return 0.0
    k = np.linspace(0, total - 1, min(total, _PAIRS)).astype(np.int64)
    # Pair k of all with a < b, in the order of b.
    b = np.floor((1.0 + np.sqrt(1.0 + 8.0 * k)) / 2.0).astype(np.int64).clip(1, segments - 1)
    a = (k - b * (b - 1) // 2).clip(0, b - 1)
    x, y = (points - points[0]).T

    def side(i: IntArray, j: IntArray) -> NDArray[np.bool_]:
        """Return on which side of segment i point j lies."""
        across = (x[i + 1] - x[i]) * (y[j] - y[i]) - (y[i + 1] - y[i]) * (x[j] - x[i])
        return np.asarray(across > 0.0)

    crossing = (side(a, b) != side(a, b + 1)) & (side(b, a) != side(b, a + 1)) & (b > a + 1)
    return float(crossing.sum()) * total / len(k)


def _joined(points: FloatArray) -> shapely.LineString:
    return shapely.LineString(np.concatenate([points, points[:1]]))


def _gap(points: FloatArray) -> float:
    return math.dist(points[0], points[-1])


def _tails(stroke: Trace, tail: float) -> tuple[shapely.LineString, shapely.LineString]:
    length = stroke.length
    return (
        shapely.LineString(stroke.part(0.0, tail)),
        shapely.LineString(stroke.part(length - tail, length)),
    )


def _closed(stroke: Trace, longest: float) -> shapely.LineString | None:
    """Return a stroke with its ends joined, or None if it is open wider than ``longest``.

    It may run on beside its own start without crossing it: then its tail is cut where it comes
    nearest to the other end.
    """
    points, length = stroke.points, stroke.length
    gap = _gap(points)
    if gap > _ROUNDING * length:
        tail = min(_BEND * gap, _END * length)
        early, late = _tails(stroke, tail)
        first, last = shapely.points(points[0]), shapely.points(points[-1])
        if min(gap, early.distance(last), late.distance(first)) > longest:
            return None
        points = min(
            points,
            stroke.part(early.project(last), length),
            stroke.part(0.0, length - tail + late.project(first)),
            key=_gap,
        )
    return _joined(points) if _gap(points) <= longest else None
