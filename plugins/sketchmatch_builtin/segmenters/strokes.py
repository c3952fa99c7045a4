"""Objects of a sketch drawn with a pen: one stroke around each."""

from __future__ import annotations

import math

import numpy as np
import shapely
from pydantic import Field
from shapely.ops import substring

from sketchmatch.api import InvalidInputError, Params, Reason, Segmentation, Segmenter
from sketchmatch.model import FloatArray, Scene, SceneObject, Stroke, StrokeSet

__all__ = ["StrokeSegmenter"]

# What a crossing closes must be this share of what the joined ends enclose: less is a flourish on
# the way round, not the place where the outline closes.
_MAIN_LOOP = 0.5
# A tail beside the outline's start is at most this share of the stroke, and at most this many
# times as long as the ends are apart: a half circle's arc is π/2 times its chord.
_END = 1.0 / 3.0
_BEND = 1.6
_ROUNDING = 1e-9
# Enclosed area, as a share of the squared size, below which a stroke is a line there and back.
_LINE = 1e-3
# Beyond this, coordinates are a fault, and their squares would soon overflow.
_LARGEST = 1e15
# Share of the enclosed area in separate parts from which on a person is told that they are lost.
_NOTABLE = 0.05


class StrokeSegmenter(Segmenter):
    """Takes every pen stroke as the outline of one object.

    Hands overshoot and undershoot the point where an outline closes, the *failure of
    co-termination* of [1]_. A stroke that crosses itself near its ends is closed at the crossing
    and its tails are cut; else its ends are joined, if the gap is small. The object is
    everything that the stroke encloses, so that an outline drawn over twice counts once.

    Sizes are relative to the stroke's: the larger side of its bounding box.

    References
    ----------
    .. [1] J. V. Mahoney, M. P. J. Fromherz, "Three main concerns in sketch recognition and an
       approach to addressing them", AAAI Spring Symposium on Sketch Understanding, 2002 (thesis
       2.1).
    """

    name = "strokes"
    summary = "Every pen stroke is the outline of one object; small gaps and tails are mended."
    sources = (StrokeSet,)

    class Params(Params):
        """How large a gap is closed, and how much an outline is smoothed."""

        max_gap: float = Field(
            0.25,
            ge=0.0,
            le=1.0,
            description=(
                "Largest gap in an outline that is closed, as a share of the stroke's size; "
                "strokes that are open wider are left out."
            ),
        )
        simplify: float = Field(
            0.01,
            ge=0.0,
            le=0.2,
            description=(
                "How far a simplified outline may leave the stroke, as a share of its size."
            ),
        )

    params: Params

    def segment(self, source: StrokeSet) -> Segmentation:
        """Return the closed strokes as objects, in the order they were drawn."""
        objects: list[SceneObject] = []
        warnings: list[str] = []
        for k, stroke in enumerate(source.strokes):
            points = _checked(stroke, f"strokes[{k}]")
            name = f"strokes[{k}] ({stroke.label})" if stroke.label else f"strokes[{k}]"
            areas = self._enclosed(points)
            if not areas:
                warnings.append(f"{name} was left out: {_why_open(points)}")
                continue
            if areas[0].area < (1.0 - _NOTABLE) * _total(areas):
                warnings.append(f"{name} encloses separate areas: the largest alone was taken.")
            outline = areas[0].simplify(self.params.simplify * _size(points))
            ring = shapely.get_coordinates(outline)
            objects.append(SceneObject.from_rings([ring], stroke.label))
        if len(objects) < 2:
            raise _too_few(len(objects), len(source.strokes) - len(objects), self.params.max_gap)
        return Segmentation(Scene(tuple(objects)), tuple(warnings))

    def _enclosed(self, points: FloatArray) -> list[shapely.Polygon]:
        """Return the separate areas that a stroke encloses, largest first; none if it is open."""
        line = shapely.LineString(points)
        areas = _areas(line)
        if _total(areas) < _MAIN_LOOP * _total(_areas(_joined(line))):
            closed = _closed(line, self.params.max_gap * _size(points))
            areas = [] if closed is None else _areas(closed)
        return areas if _total(areas) >= _LINE * _size(points) ** 2 else []


def _checked(stroke: Stroke, field: str) -> FloatArray:
    """Return a stroke's points without repetitions, shape (k, 2)."""
    points = stroke.points
    usable = (np.abs(points) < _LARGEST).all(axis=1)
    if not usable.all():
        k = int(np.argmin(usable))
        fault = "too large" if np.isfinite(points[k]).all() else "not finite"
        raise InvalidInputError(
            Reason.INVALID_STROKE, f"{field}.points[{k}]", f"is {fault}; give plain numbers"
        )
    moved = np.ones(len(points), dtype=bool)
    moved[1:] = (points[1:] != points[:-1]).any(axis=1)
    if moved.sum() < 2:
        count = {0: "no point", 1: "one point"}.get(len(points), "no length")
        raise InvalidInputError(
            Reason.INVALID_STROKE, field, f"has {count}; draw an outline there or remove it"
        )
    return points[moved]


def _size(points: FloatArray) -> float:
    return float(np.ptp(points, axis=0).max())


def _areas(line: shapely.LineString) -> list[shapely.Polygon]:
    """Return the separate areas that a line encloses, largest first."""
    noded = shapely.get_parts(shapely.union_all([line]))
    enclosed = shapely.union_all(shapely.get_parts(shapely.polygonize(noded)))
    return sorted(shapely.get_parts(enclosed), key=lambda area: -area.area)


def _total(areas: list[shapely.Polygon]) -> float:
    return sum(area.area for area in areas)


def _part(line: shapely.LineString, start: float, end: float) -> shapely.LineString:
    return shapely.LineString(substring(line, start, end).coords)


def _joined(line: shapely.LineString) -> shapely.LineString:
    return shapely.LineString([*line.coords, line.coords[0]])


def _gap(line: shapely.LineString) -> float:
    return math.dist(line.coords[0], line.coords[-1])


def _closed(line: shapely.LineString, longest: float) -> shapely.LineString | None:
    """Return a line with its ends joined, or None if it is open wider than ``longest``.

    A line may run on beside its own start without crossing it: then its tail is cut where it
    comes nearest to the other end.
    """
    gap, length = _gap(line), line.length
    if gap > _ROUNDING * length:
        tail = min(_BEND * gap, _END * length)
        first, last = shapely.get_point(line, 0), shapely.get_point(line, -1)
        early, late = _part(line, 0.0, tail), _part(line, length - tail, length)
        line = min(
            line,
            _part(line, early.project(last), length),
            _part(line, 0.0, length - tail + late.project(first)),
            key=_gap,
        )
    return _joined(line) if _gap(line) <= longest else None


def _why_open(points: FloatArray) -> str:
    gap = math.dist(points[0], points[-1]) / _size(points)
    if gap < 0.01:
        return "it encloses nothing; draw around the object."
    return f"its ends are {gap:.0%} of its size apart; close the outline or raise max_gap."


def _too_few(found: int, left_out: int, max_gap: float) -> InvalidInputError:
    outlines = "no closed outline" if not found else "one closed outline"
    strokes = "1 stroke was" if left_out == 1 else f"{left_out} strokes were"
    lost = f" ({strokes} left out: open wider than {max_gap:.0%} of the size, or only a line)"
    return InvalidInputError(
        Reason.TOO_FEW_OBJECTS,
        "strokes",
        f"hold {outlines}{lost if left_out else ''}, and a match needs two; "
        "draw around each object with one stroke",
    )
