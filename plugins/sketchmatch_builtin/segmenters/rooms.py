"""Rooms of a robot's map or of a drawn floor plan: free space cut at its doorways."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Container, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import cast

import cv2
import numpy as np
import shapely
from pydantic import Field

from sketchmatch.api import InvalidInputError, Reason, Segmentation, Segmenter
from sketchmatch.model import (
    FloatArray,
    Image,
    IntArray,
    Landmark,
    OccupancyGrid,
    PolygonSet,
    Scene,
    SceneObject,
    StrokeSet,
)
from sketchmatch.model.limits import source_limits
from sketchmatch_builtin.segmenters._cells import (
    TOLERANCE,
    FreeSpaceParams,
    Mask,
    free_cells,
    holes,
    in_map,
    outlines,
    reading_order,
    refuse_more,
    simplified,
)
from sketchmatch_builtin.segmenters._doorways import Labels, divided, doorway, parts_that_meet
from sketchmatch_builtin.segmenters._landmarks import (
    ROOM,
    labels_of,
    left_over,
    names_of_rooms,
)
from sketchmatch_builtin.segmenters._leaves import divided_at_openings
from sketchmatch_builtin.segmenters._plan_things import (
    between_walls,
    dimensions,
    paper,
    standing,
    things_in,
    within,
)
from sketchmatch_builtin.segmenters._plans import Plan, drawn, lines_of
from sketchmatch_builtin.segmenters._spaces import spaces_between
from sketchmatch_builtin.segmenters._swings import is_swing
from sketchmatch_builtin.segmenters._widths import divided_by_width

__all__ = ["RoomSegmenter"]

_MOST_HOLES = 1000

# In metres: no doorway is wider, unless a parameter says so.
_WIDEST = 2.1
# A map of more cells is looked at in larger ones, as long as a doorway is so many of these wide.
_MANY, _FINE = 4_000_000, 20
# In metres and square metres, likewise: longest furniture, smallest room.
_FURNITURE, _SMALLEST = 2.0, 2.0
# In a drawing, of the width of the wider room: what is narrower is another one; and in its other
# cuts, a coarser and a finer one.
_NARROW = 0.5
_OTHERWISE_NARROW = (0.4, 0.6)
# Cells along the longer side of a drawing in which rooms are looked for without what is in them.
_COARSE_SIDE = 400
# In a drawing of more lines that is not looked for: every two that meet would be looked at.
_MOST_LINES = 3000
# Rooms of a plan.
_FEWEST = 2
# Of its longer side: half the width from which a room counts.
_NARROWEST = 0.006
# The smallest room: of all of them together, and of the mean one where they are many, with a door
# that leads into it and without.
_SMALLEST_SHARE, _SMALL_ENTERED, _SMALL = 0.01, 0.1, 0.2
# Of all of them together, likewise: what is smaller is no room, whatever leads into it.
_SMALLEST_ENTERED = 0.002


class RoomSegmenter(Segmenter):
    """Takes rooms as objects: free space, cut where it is narrow.

    Free space is cut where a disc as wide as a door does not fit [1]_. What is left is a room or
    part of one; what was cut away goes to the nearest part, of several to the largest. The map
    itself gives that width: three times the mean distance of free cells to the nearest wall, which
    is half the width of a square room; what is narrower, as a hall with a bath beside it, is cut
    once more by the width of its own. Parts joined by a passage nearly as wide as the wider of
    them are one room, so that a corridor stays whole; so are corridors and the place where they
    meet or bend, if a larger disc fits there than into any of them. A convex part joined to the
    rest of its room by one opening, wider than a doorway but narrower than itself, is a room of its
    own, unless ``door_width`` is given or it lies at a corridor that fills less than a fifth of its
    hull. A laser's rays through glass and the insides of cupboards' outlines are not rooms. Things
    that stand free in a room and are no longer than ``furniture`` neither cut it nor are holes in
    it; longer ones are holes. All other unknown and occupied cells belong to no room, and two rooms
    are always at least a cell apart. A rotated map has the same rooms, rotated. A map of more than
    four million cells is processed in cells twice as large, or larger, as long as a doorway is 20
    of these wide.

    In a drawing, walls are strokes, the borders of polygons and open lines, or one of two shades of
    a picture, in which either the walls or the free space may be dark; what joins the picture's
    border is outside. Metres are unknown there, so everything is measured relative to the drawing:
    free space is cut where it becomes less than half as wide [2]_, at doors as well as where a
    corridor opens into a hall. A drawn door, a leaf with its swing arc or an arc alone with walls
    at its middle and an end, is closed: it is not a wall, and a room ends there. Dashed lines, such
    as beams, rugs and axes, are not walls if others bound rooms; nor is what a later, opaque
    filling hides of an outline. Small closed strokes are furniture if they stand free in a room, or
    at its walls while rooms open into each other; evenly spaced parallel lines are ruled paper,
    many of them or a thin grid of few, unless they end at walls, cross none and part rooms; and a
    separate straight line with ticks at both ends is a dimension. If the rooms are shapes of their
    own with names, what is left between them without a name is no room. A match may use another
    cut, where free space becomes less than 0.4 or 0.6 times as wide. A room is named by the largest
    text in it that is not a measure or a compass's letter, or else by a label that only one line
    has. If polygons come with texts, as from DXF, their labels are those of layers and blocks.

    Rooms come in reading order: by their highest point from the top down, then from the left. An
    entry of the map's file with the type ``room`` names the room in which its place lies.

    Notes
    -----
    On ten of the twenty floors of [1]_, each empty and with furniture, 509 of 560 rooms marked by
    hand are found, and of the 532 from 0.3 m² on 95 %: a room shares more than half of what both
    cover. It was tuned on every second building by name, where 296 of 322 are found; on the others
    213 of 238, where what is done at crossings was seen to be needed, too. Of the 291 rooms found
    on the ten empty floors 287 are found when these are turned by 37°, and five others: but for one
    they are on a floor whose corridors are as wide as the widest doorway. All are found on cells of
    half the size, and two more, one of them in the half that it was tuned on. Recall and precision
    as [1]_ measures them, how much of a room and of a segment the largest overlap is, are 97.6 and
    95.4 % empty, 92.2 and 95.8 % with furniture, of outlines and without the rooms below 0.3 m². Of
    all twenty floors its own figures, as others quote them: morphological 98.1 and 88.5 %, 84.6 and
    90.5 %; distance transform 96.9 and 88.4 %, 76.1 and 88.4 %; Voronoi 95.0 and 94.8 %, 86.6 and
    94.5 %; feature-based 89.2 and 90.4 %, 85.1 and 87.1 %. Neither its other ten floors nor its
    smallest rooms are in ours. MAORIS [2]_ reports 0.98 by Matthews' coefficient, on empty floors,
    which was not measured here.

    Of 12 masks that people drew of one building from memory, matched with its plan, 77 of 84
    regions whose partners [2]_'s two annotators agree on have such a partner; of the lines and
    groups, counted with each annotator, 78 of 85 are right. In the half on which the cuts were
    tuned it is 41 of 47 and 40 of 44, in the other 36 of 37 and 38 of 41. With one cut of either
    side and no groups it is 36 of 47 and 37 of 44, in the other half 32 of 35 and 33 of 42. Of the
    annotators' 117 sets of regions 78 are found: the others are mostly nooks that no cut parts. Of
    two robots' maps of a flat, matched with its layout, 10 of 10 and 6 of 7 are right: in the
    second a part of the hall, which is a region of the map, is of the whole hall to the annotator.

    References
    ----------
    .. [1] R. Bormann, F. Jordan, W. Li, J. Hampp, M. Hägele, "Room segmentation: survey,
       implementation, and analysis", ICRA 2016: morphological and distance transform segmentation.
    .. [2] M. Mielle, M. Magnusson, A. J. Lilienthal, "A method to segment maps from different
       modalities using free space layout: MAORIS, map of ripples segmentation", ICRA 2018.

    Examples
    --------
    Two rooms with a door of 0.8 m between them, 3.6 × 3.2 m and 3.6 × 3.6 m.

    >>> import numpy as np
    >>> from sketchmatch.model import OccupancyGrid
    >>> cells = np.full((22, 40), 100, np.int8)
    >>> cells[2:20, 2:18] = cells[10:14, 18:20] = cells[2:20, 20:38] = 0
    >>> params = RoomSegmenter.Params(door_width=0.8)
    >>> scene = RoomSegmenter(params).segment(OccupancyGrid(cells, 0.2)).scene
    >>> [round(item.area, 2) for item in scene.objects]
    [11.52, 12.96]
    """

    name = "rooms"
    summary = "Rooms of a robot's occupancy grid or of a drawn floor plan, cut at the doorways."
    sources = (OccupancyGrid, StrokeSet, PolygonSet, Image)

    class Params(FreeSpaceParams):
        """What is free, how wide doorways are, and what is too small to be a room."""

        door_width: float | None = Field(
            None,
            gt=0.0,
            le=1e4,
            description=(
                "Widest passage that is a doorway; by default half the width of a robot's map's "
                "typical room, but at most 2.1 m, and in a drawing half the width of the wider "
                "part that it joins. For drawings, metres here mean the drawing's own unit."
            ),
            json_schema_extra={"unit": "m"},
        )
        min_area: float | None = Field(
            None,
            ge=0.0,
            le=1e6,
            description=(
                "Rooms smaller than this are left out; by default 2 m², and in a drawing a "
                "hundredth of all rooms or, if these are many, a fifth of the mean room, and a "
                "tenth of it where a door leads into them."
            ),
            json_schema_extra={"unit": "m²"},
        )
        furniture: float | None = Field(
            None,
            ge=0.0,
            le=1e4,
            description=(
                "Longest free-standing thing that is furniture and belongs to the room around it; "
                "longer ones are walls, which may separate rooms. By default 2 m, and in a drawing "
                "the width of a doorway."
            ),
            json_schema_extra={"unit": "m"},
        )
        tolerance: float | None = Field(
            None,
            ge=0.0,
            le=10.0,
            description=(
                "Largest deviation of a simplified outline from the cells' borders; three quarters "
                "of a cell by default."
            ),
            json_schema_extra={"unit": "m"},
        )

    params: Params

    def segment(self, source: OccupancyGrid | StrokeSet | PolygonSet | Image) -> Segmentation:
        """Return the rooms, in metres in the map's frame or in the drawing's unit and frame."""
        return next(self.cuts(source))

    def cuts(
        self, source: OccupancyGrid | StrokeSet | PolygonSet | Image
    ) -> Iterator[Segmentation]:
        """Yield the rooms, and of a drawing a coarser and a finer cut, where they have two rooms.

        Where a width of doorways is given there is one cut.
        """
        if isinstance(source, OccupancyGrid):
            yield self._of_map(source)
            return
        plan = self._plan(source)
        parts, least = self._rooms(plan)
        yield self._of_plan(source, plan, parts, least)
        if self.params.door_width is None:
            for cut in self._cuts(plan, *_OTHERWISE_NARROW):
                with suppress(InvalidInputError):
                    yield self._of_plan(source, plan, cut(least), least)

    def _of_map(self, source: OccupancyGrid) -> Segmentation:
        params, cell = self.params, source.resolution
        free, corner = free_cells(source, params)
        widest = _WIDEST if params.door_width is None else params.door_width
        step = _coarser(free.size, widest / cell)
        free, cell = _coarse(free, step), step * cell
        inside = _furnished(
            free, (_FURNITURE if params.furniture is None else params.furniture) / cell
        )
        width = params.door_width
        door = doorway(inside, _WIDEST / cell) if width is None else width / cell
        area = _SMALLEST if params.min_area is None else params.min_area
        least = max(area / cell**2, 1.0)
        rooms = (divided_at_openings if width is None else divided)(inside, door, least)
        cut = f"at passages of up to {door * cell:.2g} m"
        found, passages = self._outlines(inside, rooms, least, cell, "cells", cut)
        rooms_in_map = [
            [in_map(step * ring + corner, source) for ring in _rings(room)] for room in found
        ]
        labels, unplaced = labels_of(
            [shapely.Polygon(outer, inner) for outer, *inner in rooms_in_map],
            [item for item in source.landmarks if item.kind == ROOM],
            0.0,
        )
        objects = map(SceneObject.from_rings, rooms_in_map, labels)
        warnings = left_over(unplaced, "around", "the map's file")
        return Segmentation(Scene(tuple(objects)), warnings, passages=passages)

    def _plan(self, source: StrokeSet | PolygonSet | Image) -> Plan:
        """Return the free cells of a drawing, furniture among them."""
        width = self.params.door_width
        if not isinstance(source, StrokeSet):
            return self._emptied(drawn(source, width))
        left_out = self._things(source)
        dashed = {k for k in left_out if source.strokes[k].dashed}
        if dashed and width is None:
            # A rug or a beam tells how wide doors are, as all that is drawn in rooms does.
            full = drawn(source, None, left_out=left_out - dashed)
            width = full.door * full.cell
        return self._emptied(drawn(source, width, left_out=left_out))

    def _things(self, source: StrokeSet) -> frozenset[int]:
        """Return the lines of a drawing that are things in its rooms, its paper, or say lengths."""
        lines, names = lines_of(source), source.landmarks
        aside = self._dashed(source)
        if len(lines) > _MOST_LINES:
            return aside
        # What is dashed, as a porch or an axis, may cross a dimension without joining it to walls.
        solid = [line[:0] if k in aside else line for k, line in enumerate(lines)]
        aside |= self._paper(source, solid, aside) | dimensions(solid)
        free, touching = things_in(lines, names)
        if not (free or touching):
            return aside
        things = [*touching, *itertools.chain(*free)]
        plan, rooms = self._rooms_without(source, aside.union(things, within(lines, things)))
        count = int(rooms.max())
        if count < _FEWEST:
            return aside
        cells = np.array([plan.cell, *plan.corner])
        stand = standing(free, lines, names, rooms, cells)
        found = aside.union(stand, within(lines, stand))
        opening = np.unique(parts_that_meet(plan.free | plan.doors, rooms))
        # Where rooms open into each other, what bounds one is more than a line, or has gaps; but
        # of a line that bounds a wall more rooms are found without it.
        if touching and 2 * len(opening) > count:
            found |= {*touching} if count <= self._rooms_without(source, found)[1].max() else set()
        return found

    def _paper(
        self, source: StrokeSet, solid: Sequence[FloatArray], left_out: frozenset[int]
    ) -> frozenset[int]:
        """Return the lines of a drawing's paper, but not those that bound rooms."""
        ruled = paper(lines_of(source), [stroke.width for stroke in source.strokes])
        if not any(len(line) for k, line in enumerate(solid) if k not in ruled):
            # Nothing is drawn on it.
            return frozenset()
        walls = between_walls(solid, ruled - left_out)
        if not walls:
            return ruled
        # Treads of stairs end at walls, too, and there are no rooms between them.
        fewer, more = (
            self._rooms_without(source, left_out | each)[1].max() for each in (ruled, ruled - walls)
        )
        return ruled - walls if fewer < more else ruled

    def _dashed(self, source: StrokeSet) -> frozenset[int]:
        """Return the dashed lines that are no doors, unless it is they that bound rooms."""
        found = frozenset(
            k
            for k, stroke in enumerate(source.strokes)
            if stroke.dashed and not is_swing(stroke.points)
        )
        solid = any(len(each.points) for k, each in enumerate(source.strokes) if k not in found)
        if not (found and solid) or self._rooms_without(source, found)[1].max() < _FEWEST:
            return frozenset()
        return found

    def _rooms_without(self, source: StrokeSet, left_out: Container[int]) -> tuple[Plan, Labels]:
        """Return a plan in larger cells without some lines, and the number of each cell's room."""
        width = self.params.door_width
        plan = self._emptied(drawn(source, width, left_out=left_out, side=_COARSE_SIDE))
        return plan, _numbered(*self._rooms(plan))

    def _emptied(self, plan: Plan) -> Plan:
        """Return a plan without the things that stand free."""
        longest = self.params.furniture
        longest = plan.door if longest is None else longest / plan.cell
        return replace(plan, free=_furnished(plan.free, longest))

    def _rooms(self, plan: Plan) -> tuple[Mask, float]:
        """Return the rooms of a plan, and the area of the smallest, in cells."""
        area, total = self.params.min_area, float(np.count_nonzero(plan.free))
        (cut,) = self._cuts(plan, _NARROW)
        if area is not None:
            least = max(area / plan.cell**2, 1.0)
            return cut(least), least
        least, fine = max(_SMALLEST_SHARE * total, 1.0), max(_SMALLEST_ENTERED * total, 1.0)
        parts = cut(least)
        smallest = min(_smallest(plan, parts, least), _smallest_entered(plan, cut(fine), fine))
        if smallest < least:
            least = max(smallest, 1.0)
            parts = cut(least)
        return parts, least

    def _cuts(self, plan: Plan, *shares: float) -> list[Callable[[float], Mask]]:
        """Return what cuts a plan into rooms from so many cells on, for each share."""
        if self.params.door_width is not None:
            return [partial(divided, plan.free, plan.door)]
        return divided_by_width(plan.free, shares, _NARROWEST * max(plan.free.shape))

    def _of_plan(
        self, source: StrokeSet | PolygonSet | Image, plan: Plan, parts: Mask, least: float
    ) -> Segmentation:
        width = self.params.door_width
        cut = "where it is less than half as wide"
        if width is not None:
            cut = f"at passages of up to {width:.2g}"
        path = {"stroke_set": "strokes", "polygon_set": "polygons", "image": "pixels"}[source.field]
        free = plan.free | plan.doors
        found, passages = self._outlines(free, parts, least, plan.cell, path, cut)
        rooms = [[plan.cell * ring + plan.corner for ring in _rings(room)] for room in found]
        areas = [shapely.Polygon(outer, inner) for outer, *inner in rooms]
        labels, warnings = _named(areas, source)
        lines = () if isinstance(source, Image) else lines_of(source)
        spaces = spaces_between(areas, labels, lines)
        kept = [k for k in range(len(rooms)) if k not in spaces]
        place = {k: n for n, k in enumerate(kept)}
        return Segmentation(
            Scene(tuple(SceneObject.from_rings(rooms[k], labels[k]) for k in kept)),
            (*warnings, *_without_spaces(len(spaces))),
            passages=tuple((place[a], place[b]) for a, b in passages if a in place and b in place),
        )

    def _outlines(
        self,
        free: Mask,
        rooms: Mask,
        least: float,
        cell: float,
        path: str,
        cut: str,
    ) -> tuple[list[shapely.Polygon], tuple[tuple[int, int], ...]]:
        """Return rooms, components of cells, as outlines in reading order, and who meets whom."""
        labels = _numbered(rooms, least)
        count = int(labels.max(initial=0))
        refuse_more(count, source_limits().max_objects, "raise min_area")
        if count < _FEWEST:
            raise _too_few(count, path, least * cell**2, cut)
        tolerance = self.params.tolerance
        found = _simplified(_polygons(labels), TOLERANCE if tolerance is None else tolerance / cell)
        order = sorted(range(len(found)), key=lambda k: reading_order(found[k]))
        place = np.zeros(len(found) + 1, np.int32)
        place[np.add(order, 1)] = np.arange(1, len(found) + 1)
        meeting = parts_that_meet(free, place[labels]) - 1
        return [found[k] for k in order], tuple((a, b) for a, b in meeting.tolist())


def _smallest(plan: Plan, parts: Mask, least: float) -> float:
    """Return the area of the smallest room, where some that are closed may be smaller than least.

    It is infinite where there is none.
    """
    # What has no part may be as large: what discs cover of a space lacks its corners.
    spaces = _numbered(plan.free, 0.0)
    closets = _areas(spaces)
    closets[spaces[parts > 0] - 1] = 0
    rooms = _areas(_numbered(parts, least))
    areas, means = _with_means(np.concatenate([rooms, closets[closets > 0]]))
    # Up to where they become much smaller at once, as what is hatched does.
    count = int(np.argmin(np.append(areas >= _SMALL * means, False)))
    return _SMALL * float(means[count - 1]) if count else math.inf


def _smallest_entered(plan: Plan, parts: Mask, least: float) -> float:
    """Return the same of rooms that open into others, as nothing does that is hatched."""
    rooms = _numbered(parts, least)
    entered = np.unique(parts_that_meet(plan.free | plan.doors, rooms))
    areas, means = _with_means(_areas(rooms)[entered[entered > 0] - 1])
    large = np.flatnonzero(areas >= _SMALL_ENTERED * means)
    return _SMALL_ENTERED * float(means[large[-1]]) if large.size else math.inf


def _with_means(areas: IntArray) -> tuple[IntArray, FloatArray]:
    """Return areas, the largest first, and for each the mean of those up to it."""
    ordered = np.sort(areas)[::-1]
    return ordered, ordered.cumsum() / np.arange(1, len(ordered) + 1)


def _areas(labels: Labels) -> IntArray:
    """Return how many cells each room has, by number from 1."""
    return np.bincount(labels.reshape(-1))[1:]


def _numbered(rooms: Mask, least: float) -> Labels:
    """Return the number of each cell's room, from 1, and 0 where none has so many cells."""
    _, parts, statistics, _ = cv2.connectedComponentsWithStats(rooms, connectivity=8)
    large = statistics[:, cv2.CC_STAT_AREA] >= least
    large[0] = False
    numbers = np.where(large, np.cumsum(large), 0).astype(np.int32)
    return np.asarray(numbers[parts], dtype=np.int32)


def _named(
    rooms: list[shapely.Polygon], source: StrokeSet | PolygonSet | Image
) -> tuple[list[str], tuple[str, ...]]:
    """Return what a drawing calls each room, and a warning about names written among the rooms.

    What is written counts first, then what single lines are called. Beside the rooms titles are
    written, and several names in one.
    """
    if isinstance(source, Image):
        return [""] * len(rooms), ()
    labels, unplaced = labels_of(rooms, names_of_rooms(source.landmarks), 0.0)
    free = [k for k, label in enumerate(labels) if not label]
    if isinstance(source, StrokeSet) or not source.landmarks:
        called, _ = labels_of([rooms[k] for k in free], _called(source), 0.0)
        for k, label in zip(free, called, strict=True):
            labels[k] = label
    if not unplaced:
        return labels, ()
    hull = shapely.convex_hull(shapely.union_all(rooms))
    taken = shapely.union_all([room for room, label in zip(rooms, labels, strict=True) if label])
    lost = hull - taken
    return labels, left_over(
        [item for item in unplaced if lost.contains(shapely.Point(item.point))],
        "around",
        "the drawing",
    )


def _without_spaces(count: int) -> tuple[str, ...]:
    """Return what is said of spaces that are no rooms."""
    if not count:
        return ()
    spaces = "A space" if count == 1 else f"{count} spaces"
    return (f"{spaces} between rooms that are shapes with names: left out, having no name.",)


def _called(source: StrokeSet | PolygonSet) -> list[Landmark]:
    """Return what outlines are called, each in its middle."""
    lines = (
        [(stroke.label, stroke.points) for stroke in source.strokes]
        if isinstance(source, StrokeSet)
        else [(polygon.label, polygon.rings[0]) for polygon in source.polygons if polygon.rings]
    )
    given = Counter(label for label, _ in lines)
    # What several lines are called is a layer or a kind of line, and no room.
    return [
        Landmark(label, (float(x), float(y)), ROOM)
        for label, points in lines
        if label and given[label] == 1 and len(points)
        for x, y in [(points.min(axis=0) + points.max(axis=0)) / 2.0]
    ]


def _coarser(cells: int, door: float) -> int:
    """Return how many cells along each side are looked at as one."""
    return max(1, min(math.ceil(math.sqrt(cells / _MANY)), int(door / _FINE)))


def _coarse(free: Mask, step: int) -> Mask:
    """Return cells so many times as large, free where all that they hold are."""
    if step == 1:
        return free
    rows, columns = (-(-side // step) * step for side in free.shape)
    padded = np.zeros((rows, columns), np.uint8)
    padded[: free.shape[0], : free.shape[1]] = free
    down = np.minimum.reduce([padded[k::step] for k in range(step)])
    return np.asarray(np.minimum.reduce([down[:, k::step] for k in range(step)]), dtype=np.uint8)


def _furnished(free: Mask, longest: float) -> Mask:
    """Return free cells together with the things, no longer than so many cells, among them."""
    # What an outline of a thing encloses is of the thing.
    things = (1 - free) | _small(free, longest, 4)
    framed = np.pad(things, 1, constant_values=1)
    return np.asarray(_small(framed, longest, 8)[1:-1, 1:-1] | free)


def _small(mask: Mask, longest: float, connectivity: int) -> Mask:
    """Return a mask's components whose sides are at most so long, without that at its corner."""
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(mask, connectivity=connectivity)
    small = statistics[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1) <= longest
    # What lies outside the map is no thing, however small the map is.
    small[[0, labels[0, 0]]] = False
    return np.asarray(small[labels], dtype=np.uint8)


def _polygons(labels: Labels) -> list[shapely.Polygon]:
    """Return the outlines of rooms, of which each cell has the number, their holes left out."""
    rooms = (labels > 0).view(np.uint8)
    outer = {int(labels[cell]): ring for cell, ring in outlines(rooms)}
    inner: dict[int, list[FloatArray]] = {number: [] for number in outer}
    for (row, column), ring in outlines(holes(rooms)):
        # What lies before the first cell of a hole is of the room around it.
        inner[int(labels[row - 1, column])].append(ring)
    return [_with_holes(outer[number], inner[number]) for number in range(1, len(outer) + 1)]


def _with_holes(outer: FloatArray, inner: list[FloatArray]) -> shapely.Polygon:
    """Return the largest piece of what an outline encloses and others do not."""
    refuse_more(len(inner), _MOST_HOLES, "raise furniture")
    if not inner:
        return shapely.Polygon(outer)
    if len(inner) == 1:
        # Most often, and soon done; the hole runs the other way round.
        plain = shapely.Polygon(outer, [inner[0][::-1]])
        if plain.is_valid:
            return plain
    pieces = shapely.Polygon(outer) - shapely.union_all([shapely.Polygon(ring) for ring in inner])
    return cast(shapely.Polygon, max(shapely.get_parts(pieces), key=lambda part: part.area))


def _simplified(outlines: list[shapely.Polygon], tolerance: float) -> list[shapely.Polygon]:
    """Return the outlines simplified, and those left as they are that would then overlap."""
    result = np.array([simplified(_begun(exact), tolerance) for exact in outlines], dtype=object)
    kept = np.zeros(len(result), dtype=bool)
    while True:
        a, b = shapely.STRtree(result).query(result)
        a, b = a[a < b], b[a < b]
        shapely.prepare(result)
        meet = shapely.intersects(result[a], result[b])
        touching = np.unique(np.concatenate([a[meet], b[meet]]))
        touching = touching[~kept[touching]]
        if not touching.size:
            return list(result)
        kept[touching] = True
        result[touching] = [outlines[k] for k in touching]


def _begun(room: shapely.Polygon) -> shapely.Polygon:
    """Return a room whose rings begin at their farthest corners, wherever they began.

    What is left of a ring depends on where it begins, and must not depend on how the map lies.
    """
    outer, *inner = (_from_farthest(ring) for ring in _rings(room))
    return shapely.Polygon(outer, inner)


def _from_farthest(ring: FloatArray) -> FloatArray:
    """Return a closed ring begun where it is farthest from the mean of its corners."""
    corners = ring[:-1]
    # As many times as there are corners: whole numbers and halves, and so without rounding.
    away = ((len(corners) * corners - corners.sum(axis=0)) ** 2).sum(axis=1)
    farthest = np.flatnonzero(away == away.max()).tolist()
    first = farthest[0]
    if len(farthest) > 1:
        first = max(farthest, key=lambda k: np.roll(away, -k).tolist())
    return np.roll(corners, -first, axis=0)


def _rings(room: shapely.Polygon) -> list[FloatArray]:
    if not room.interiors:
        return [shapely.get_coordinates(room)]
    return [shapely.get_coordinates(ring) for ring in (room.exterior, *room.interiors)]


def _too_few(found: int, path: str, area: float, cut: str) -> InvalidInputError:
    square = " m²" if path == "cells" else ""
    return InvalidInputError(
        Reason.TOO_FEW_OBJECTS,
        path,
        f"has {'no room' if not found else 'only one room'} of at least {area:.3g}{square} "
        f"when cut {cut}, and a match needs two; give a map with several rooms, raise door_width "
        "or lower min_area",
    )
