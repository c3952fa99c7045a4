"""Objects of a sketch drawn with a pen: a stroke around each, or several."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Literal

import numpy as np
import shapely
from pydantic import Field

from sketchmatch.api import InvalidInputError, Params, Reason, Segmentation, Segmenter
from sketchmatch.model import FloatArray, Landmark, Scene, SceneObject, Stroke, StrokeSet

from ._landmarks import labels_of, names_of_rooms
from ._strokes_chains import closed_chains
from ._strokes_drawing import (
    DOT,
    FLICK,
    FRAME,
    LONGHAND,
    ROUTE,
    TANGLED,
    WRITING,
    Drawing,
    Outline,
)
from ._strokes_marks import (
    along_others,
    are_straight,
    frames,
    hosts,
    places,
    repeated,
    typical_span,
)
from ._strokes_outline import areas_of, enclosed_by, own_gap, tangled, total_of
from ._strokes_trace import LATELY, LONGEST, traced
from ._writing import written

__all__ = ["StrokeSegmenter"]

# Beyond this, coordinates are a fault, and their squares would soon overflow.
_LARGEST = 1e15
# Share of the enclosed area in separate parts from which on a person is told that they are lost.
_NOTABLE = 0.05
# Longhand closes in many loops: none has this share of what they enclose.
_LOOP = 0.5
# A stroke that closes by itself over a gap wider than this share of its span may be part of more.
_WIDE = 0.05
# Inside another outline, what is this many times ``min_size`` is still a mark.
_MARK = 3.0
# … and so are strokes in it that make a chain this much of which is gaps.
_LOOSE = 0.1
# Several strokes that enclose this share of an object from within were drawn over it.
_RETRACED = 0.25
# Span of an unlabelled route as a share of the sketch's.
_ACROSS = 0.5
# Share of the things that stand in walls which are left out.
_MOST = 0.5
# So many straight lines across the sketch are of its paper.
_LINED = 4
_ROUTE = re.compile(r"\b(route|path)\b", re.IGNORECASE)


class StrokeSegmenter(Segmenter):
    """Takes what pen strokes enclose as objects, each drawn with one stroke or several.

    Hands overshoot and undershoot the point where an outline closes, the *failure of
    co-termination* of [1]_. A stroke that crosses itself near its ends is closed at the crossing
    and its tails are cut; otherwise its ends are joined if the gap is small. The object is
    everything that the stroke encloses, so an outline drawn twice counts once.

    Strokes that stay open are joined end to end into closed chains, those with the smallest gaps
    and the shortest tails first: the perceptual organisation by proximity and good continuation of
    [2]_. What remains is a stroke drawn over an outline again, a mark inside an object, a flick, or
    the route. Small strokes close to each other in a row are taken as writing if some are open, or
    if there are several such rows.

    Outlines around most of what is drawn, such as the walls of a room or a page, are left out
    unless they have a label.

    An outline without a label is named by the text in it, if the drawing has texts.

    The size of a stroke is the larger side of its bounding box; the span of a chain or of the
    sketch is the largest distance between two points.

    References
    ----------
    .. [1] J. V. Mahoney, M. P. J. Fromherz, "Three main concerns in sketch recognition and an
       approach to addressing them", AAAI Spring Symposium on Sketch Understanding, 2002 (thesis
       2.1).
    .. [2] E. Saund, "Finding perceptually closed paths in sketches and drawings", IEEE
       Transactions on Pattern Analysis and Machine Intelligence 25(4), 2003.

    Examples
    --------
    A square whose pen stroke goes on past its corner, and one drawn with two strokes.

    >>> import numpy as np
    >>> from sketchmatch.model import Stroke, StrokeSet
    >>> desk = Stroke(np.array([[0.0, -1], [0, 4], [4, 4], [4, 0], [-1, 0]]), label="desk")
    >>> sides = Stroke(np.array([[8.0, 0], [8, 4], [12, 4]]))
    >>> others = Stroke(np.array([[12, 3.8], [12, 0], [8.2, 0]]))
    >>> scene = StrokeSegmenter().segment(StrokeSet((desk, sides, others))).scene
    >>> [(item.label, item.area) for item in scene.objects]
    [('desk', 16.0), ('', 16.0)]
    """

    name = "strokes"
    summary = "Objects drawn with one pen stroke or several; gaps and tails are repaired."
    default = True
    sources = (StrokeSet,)

    class Params(Params):
        """How large a gap is closed, what is too small, and how much an outline is smoothed."""

        max_gap: float = Field(
            0.25,
            ge=0.0,
            le=1.0,
            description=(
                "Largest gap in an outline that is closed, as a share of its size; strokes with a "
                "wider gap are left out."
            ),
        )
        simplify: float = Field(
            0.01,
            ge=0.0,
            le=0.2,
            description=(
                "Largest deviation of a simplified outline from the stroke, as a share of its size."
            ),
        )
        min_size: float = Field(
            0.1,
            ge=0.0,
            le=1.0,
            description=(
                "Smallest size of an object, as a share of the typical one; smaller ones are dots "
                "or flicks and are left out. Inside another object the limit is three times this. "
                "Outlines around others, such as walls and pages, do not count as typical."
            ),
        )
        frame: Literal["auto", "keep"] = Field(
            "auto",
            description=(
                "How to treat walls or a page, which are outlines without a label around at least "
                "three things each and together around half of all, far larger than these or "
                "around all others: 'auto' leaves them out, 'keep' takes them as objects."
            ),
        )
        route: Literal["auto", "never"] = Field(
            "auto",
            description=(
                "auto: the sketched route is a stroke labelled route or path, otherwise the last "
                "open one across half of the sketch. never: there is none."
            ),
        )

    params: Params

    def segment(self, source: StrokeSet) -> Segmentation:
        """Return the closed outlines as objects, in the order in which they were begun."""
        points = [_checked(stroke, f"strokes[{k}]") for k, stroke in enumerate(source.strokes)]
        empty = [k for k, each in enumerate(points) if not len(each)]
        numbers = [k for k, each in enumerate(points) if len(each)]
        points = [points[k] for k in numbers]
        drawing = Drawing(
            [traced(each) for each in points],
            [source.strokes[k].label for k in numbers],
            numbers,
        )
        if dots := [k for k, each in enumerate(points) if len(each) == 1]:
            drawing.explain(dots, DOT)
        route = _labelled_route(drawing) if self.params.route == "auto" else None
        outlines = self._outlines(drawing, route)
        objects, writing = self._objects(drawing, outlines)
        drawn = {k for item in objects for k in item.strokes}
        left = [k for k in range(len(points)) if k not in drawn | drawing.explained | {route}]
        left = self._without_marks(drawing, left, objects, writing)
        objects = self._without_frames(drawing, objects)
        if route is None and self.params.route == "auto":
            route = _route_across(drawing, left)
        for k in left:
            if k != route:
                why = _why_open(points[k])
                drawing.note(k, f"{drawing.named([k], found=True)} was left out: {why}")
        if len(objects) < 2:
            raise _too_few(len(objects), len(points) - len(drawn), self.params.max_gap)
        scene = tuple(map(_object, _named(objects, source.landmarks)))
        way = None if route is None else points[route]
        warnings = (*_without_points(empty), *drawing.sentences())
        return Segmentation(Scene(scene), warnings, way)

    def _outlines(self, drawing: Drawing, route: int | None) -> list[Outline]:
        """Return all closed outlines, of single strokes and of chains."""
        strokes, max_gap = drawing.strokes, self.params.max_gap
        closed: dict[int, Sequence[shapely.Polygon]] = {}
        pool: dict[int, float] = {}
        dots = set(drawing.explained)
        if unseen := tangled(strokes) - {route} - dots:
            drawing.explain(sorted(unseen), TANGLED)
        seen = [k for k in range(len(strokes)) if k not in unseen | dots]
        for k, over in zip(seen, along_others([strokes[k] for k in seen]), strict=True):
            stroke = strokes[k]
            areas = enclosed_by(stroke, max_gap) if k != route else ()
            if areas and areas[0].area < _LOOP * total_of(areas):
                drawing.explain([k], LONGHAND)
            elif areas:
                closed[k] = areas
                if (gap := own_gap(stroke)) > _WIDE * stroke.span:
                    pool[k] = gap
            elif k != route and over is None:
                pool[k] = math.inf
        chains = closed_chains([strokes[k] for k in pool], list(pool.values()), max_gap)
        outlines = []
        members = list(pool)
        for chain in chains:
            joined = tuple(sorted(members[k] for k in chain.strokes))
            outlines.append(self._outline(drawing, joined, areas_of(chain.line), chain.open))
        chained = {k for outline in outlines for k in outline.strokes}
        outlines += [
            self._outline(drawing, (k,), areas) for k, areas in closed.items() if k not in chained
        ]
        return sorted(outlines, key=lambda outline: outline.strokes)

    def _outline(
        self,
        drawing: Drawing,
        members: tuple[int, ...],
        areas: Sequence[shapely.Polygon],
        share: float = 0.0,
    ) -> Outline:
        size = (
            drawing.strokes[members[0]].size
            if len(members) == 1
            else float(np.ptp(shapely.get_coordinates(areas[0]), axis=0).max())
        )
        return Outline(
            members,
            shapely.simplify(areas[0], self.params.simplify * size),
            next((drawing.labels[k] for k in members if drawing.labels[k]), ""),
            share,
            areas[0].area < (1.0 - _NOTABLE) * total_of(areas),
        )

    def _writing(self, drawing: Drawing, outlines: list[Outline]) -> frozenset[int]:
        """Return the strokes that are writing beside the objects."""
        alone = {outline.strokes[0] for outline in outlines if len(outline.strokes) == 1}
        found = written(
            [each.samples for each in drawing.strokes],
            [k in alone for k in range(len(drawing.strokes))],
            _typical(outlines),
            [outline.strokes for outline in outlines],
        )
        # A match needs two.
        left = [outline for outline in outlines if not found.issuperset(outline.strokes)]
        return found if len(left) > 1 else frozenset()

    def _objects(
        self, drawing: Drawing, outlines: list[Outline]
    ) -> tuple[list[Outline], frozenset[int]]:
        """Return the outlines that are objects, and what is writing; explain the others."""
        areas = [outline.area for outline in outlines]
        first_of, within = repeated(areas), hosts(areas)
        outlines = _named_alike(outlines, first_of)
        whole = drawing.span if outlines else 0.0
        around_things = frames([outline.span for outline in outlines], within, whole)
        for k in around_things:
            outlines[k] = replace(outlines[k], frame=True)
        smallest, writing = self._smallest(outlines), self._writing(drawing, outlines)
        mark = min(_MARK * smallest, _second_largest(outlines))
        objects = []
        # What stands in walls is drawn in no thing.
        in_things = [None if k in around_things else k for k in within]
        for outline, first, around in zip(outlines, first_of, in_things, strict=True):
            members, name = outline.strokes, drawing.named(outline.strokes)
            if outline.span < smallest:
                drawing.explain(members, FLICK)
            elif first is not None:
                drawing.explain(members, drawing.again(outlines[first].strokes))
            elif around is not None and _retraces(outline, outlines[around]):
                drawing.explain(members, drawing.again(outlines[around].strokes))
            elif around is not None and (outline.span < mark or outline.open > _LOOSE):
                drawing.explain(members, drawing.inside(outlines[around].strokes))
            elif writing.issuperset(members):
                drawing.explain(members, WRITING)
            else:
                objects.append(outline)
                if around is not None:
                    host = drawing.named(outlines[around].strokes)
                    drawing.note(members[0], f"{name} inside {host} was taken as an object, too.")
                if outline.parted:
                    verb = "encloses" if len(members) == 1 else "enclose"
                    drawing.note(
                        members[0],
                        f"{name} {verb} separate areas, of which only the largest was taken.",
                    )
        return objects, writing

    def _without_frames(self, drawing: Drawing, objects: list[Outline]) -> list[Outline]:
        """Return the objects that are no walls around the others, and explain these."""
        if self.params.frame == "keep":
            return objects
        walls = [item for item in objects if item.frame and not item.label]
        if not walls:
            return objects
        things = [item for item in objects if not item.frame]
        around = shapely.union_all([wall.area for wall in walls])
        within = sum(around.intersects(thing.area.representative_point()) for thing in things)
        # A match needs two.
        if len(objects) - len(walls) < 2 or within < _MOST * len(things):
            return objects
        for wall in walls:
            drawing.explain(wall.strokes, FRAME)
        return [item for item in objects if item not in walls]

    def _smallest(self, outlines: list[Outline]) -> float:
        """Return the least span of an object: a match needs two, so two are large enough."""
        return min(self.params.min_size * _typical(outlines), _second_largest(outlines))

    def _without_marks(
        self,
        drawing: Drawing,
        left: list[int],
        objects: list[Outline],
        writing: frozenset[int],
    ) -> list[int]:
        """Explain what strokes beside objects are, and return those that are none of it."""
        along, within = places([drawing.strokes[k] for k in left], [item.area for item in objects])
        smallest = self._smallest(objects)
        others = []
        for k, border, around in zip(left, along, within, strict=True):
            if border is not None:
                drawing.explain([k], drawing.again(objects[border].strokes))
            elif around is not None and not objects[around].frame:
                drawing.explain([k], drawing.inside(objects[around].strokes))
            elif drawing.strokes[k].span < smallest:
                drawing.explain([k], FLICK)
            elif k in writing:
                drawing.explain([k], WRITING)
            else:
                others.append(k)
        return others


def _object(outline: Outline) -> SceneObject:
    """Return the object of an outline: the same one for the same outline, if met lately."""
    ring = shapely.get_coordinates(outline.area)
    if len(ring) > LONGEST:
        return SceneObject.from_rings([ring], outline.label)
    return _met_lately(ring.tobytes(), outline.label)


@lru_cache(maxsize=LATELY)
def _met_lately(ring: bytes, label: str) -> SceneObject:
    return SceneObject.from_rings([np.frombuffer(ring).reshape(-1, 2)], label)


def _named_alike(outlines: list[Outline], first_of: Sequence[int | None]) -> list[Outline]:
    """Return outlines of which those without a label have that of one that repeats them."""
    named = [*outlines]
    for outline, first in zip(outlines, first_of, strict=True):
        if first is not None and not named[first].label:
            named[first] = replace(named[first], label=outline.label)
    return named


def _retraces(outline: Outline, host: Outline) -> bool:
    """Whether several strokes inside an object go over it again, rather than stand in a room."""
    return len(outline.strokes) > 1 and outline.area.area > _RETRACED * host.area.area


def _typical(outlines: list[Outline]) -> float:
    """Return the span of the typical object, which what is around others is not."""
    return typical_span([outline.span for outline in outlines if not outline.frame])


def _second_largest(outlines: list[Outline]) -> float:
    return sorted([0.0, 0.0, *(outline.span for outline in outlines)])[-2]


def _named(outlines: list[Outline], texts: Sequence[Landmark]) -> list[Outline]:
    """Return outlines of which those without a label have the text that is written in them."""
    labels, _ = labels_of([each.area for each in outlines], names_of_rooms(texts), 0.0)
    return [
        replace(each, label=each.label or label)
        for each, label in zip(outlines, labels, strict=True)
    ]


def _labelled_route(drawing: Drawing) -> int | None:
    return next(
        (
            k
            for k, name in reversed([*enumerate(drawing.labels)])
            if _ROUTE.search(name) and k not in drawing.explained
        ),
        None,
    )


def _route_across(drawing: Drawing, left: list[int]) -> int | None:
    """Return the last of the strokes left that leads across much of the sketch, or None."""
    least = _ACROSS * drawing.span if left else 0.0
    across = [k for k in left if drawing.strokes[k].span > least]
    straight = are_straight([drawing.strokes[k] for k in across])
    # Nobody goes along many straight lines: they are those of the paper.
    if sum(straight) >= _LINED:
        across = [k for k, line in zip(across, straight, strict=True) if not line]
    if not across:
        return None
    drawing.explain(across[-1:], ROUTE)
    return across[-1]


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
    return points[moved]


def _without_points(empty: list[int]) -> tuple[str, ...]:
    """Return what is said of strokes that are nowhere."""
    if len(empty) > 1:
        return (
            f"strokes[{empty[0]}] and {len(empty) - 1} more were left out: they have no points.",
        )
    return tuple(f"strokes[{k}] was left out: it has no point." for k in empty)


def _why_open(points: FloatArray) -> str:
    gap = math.dist(points[0], points[-1]) / float(np.ptp(points, axis=0).max())
    if gap < 0.01:
        return "it encloses nothing; draw around the object."
    return f"its ends are {gap:.0%} of its size apart; close the outline or raise max_gap."


def _too_few(found: int, left_out: int, max_gap: float) -> InvalidInputError:
    outlines = "no closed outline" if not found else "one closed outline"
    strokes = "1 stroke was" if left_out == 1 else f"{left_out} strokes were"
    lost = (
        f" ({strokes} left out: open wider than {max_gap:.0%} of the size, or only a line"
        f"{', or far smaller, or a mark in it, or the same again' if found else ''})"
    )
    return InvalidInputError(
        Reason.TOO_FEW_OBJECTS,
        "strokes",
        f"hold {outlines}{lost if left_out else ''}, and a match needs two; "
        "draw around each object with one stroke",
    )
