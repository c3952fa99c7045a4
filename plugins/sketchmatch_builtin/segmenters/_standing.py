"""What stands in a room of a grid, as outlines, and how sure it is that each is one thing."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, cast

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray

from sketchmatch.model import FloatArray, IntArray
from sketchmatch.model.caching import cached_property
from sketchmatch_builtin.segmenters._at_walls import Bounds, Leans, Pocket, at_walls, is_thick
from sketchmatch_builtin.segmenters._border import outer_border
from sketchmatch_builtin.segmenters._cells import (
    Mask,
    closed,
    outlines,
    refuse_more,
    simplified,
)
from sketchmatch_builtin.segmenters._furniture import (
    FOOT,
    Bars,
    Legs,
    chairs,
    crowds,
    facing,
    tables,
)
from sketchmatch_builtin.segmenters._merging import apart, merged

__all__ = ["Parts", "Room", "Thing", "as_they_are", "at_the_walls", "furnished", "merged_within"]

_Geometries = NDArray[np.object_]

# How sure it is that parts are one thing, by what they form together.
_TABLE, _FACING, _CROWD = 0.9, 0.6, 0.6
# The share from which on something is most of the whole: of a crowd the legs of tables and chairs,
# which it is then, and no one thing.
_MOST = 0.6
# What is in a crowd may be so much larger than a leg, as legs that are near each other are one.
_CLUMP = 2.0
# A leg is what the laser met, not what it did not see.
_MET = 0.4
# Metres: the side from which on a part may be the bar that a table stands on.
_BAR, _BAR_RATIO = 0.25, 2.5
# What hangs on a wall by a neck, juts far out of it, or leans against it as its own bumps do.
_HANGING, _JUTTING, _LEANING = 0.8, 0.7, 0.4
# What fills a corner of the room, as a corner of the building does.
_CORNER = 0.3
# The share of an outline that the laser met where there is no doubt, and in a corner at least.
_SEEN, _SEEN_IN_A_CORNER = 0.5, 0.8
# At least so sure is what has some width, and at most so sure what is thin and ragged.
_COMPACT, _RAGGED = 0.3, 0.4
# Where what the laser did not see begins near what is thin, that is as doubtful. Of a speck, no
# larger than such a square, that is thin, is at such an edge, or was met by the laser on less than
# that share, two are even more so. Lengths are in what is thin: how near, how long an edge.
_SHADOW, _SPECK, _NEAR, _EDGE = 0.2, 2.0, 2.5, 2.0
# How much thicker than a wall something is at least from which walls are told.
_CLEARLY = 1.5
# The share of its hull that something straight fills.
_STRAIGHT = 0.6
_SIDES = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)
# What has more corners is looked at in pieces; how much larger the discs of an outline may be than
# those around the middles of its cells, in cells: √½, and what is drawn across corners.
_CORNERS, _ASIDE = 500, 1.1
# In cells: how far what is rougher leaves an outline, whose stairs are then straight.
_ROUGH = 0.4
# How much longer a way is at most than OpenCV says.
_LONGER = 1.02
# How much farther than an edge a corner moves at most when an outline grows.
_MITRE = 5.0
# The most that two bytes hold.
_MOST_FEW = 65535
# Legs, before they are merged to tables.
_MOST_PARTS = 10_000


class Core(NamedTuple):
    """Where an outline is widest, in cells.

    No disc of a radius beyond ``widest`` fits into it, and near (x, y) one does that is nearly as
    large as any.
    """

    widest: float
    x: float
    y: float


class Thing(NamedTuple):
    """An outline in cells, and how sure it is that it is one thing, from 0 to 1.

    Its core is known of large outlines alone.
    """

    outline: shapely.Polygon
    certainty: float
    core: Core | None = None


@dataclass(frozen=True)
class Room:
    """A free region, cropped.

    Attributes
    ----------
    free
        1 in the region.
    inside
        1 in what stands free in it.
    occupied
        1 where the laser met something.
    cell
        The side of a cell, in metres.
    small
        Thinner things are thin, in cells.
    """

    free: Mask
    inside: Mask
    occupied: Mask
    cell: float
    small: float

    @cached_property
    def met(self) -> Mask:
        """1 near where the laser met something."""
        stray = max(1, min(round(self.small / 2.0), max(self.free.shape)))
        square = np.ones((2 * stray + 1, 2 * stray + 1), np.uint8)
        return np.asarray(cv2.dilate(self.occupied, square), dtype=np.uint8)


class Parts(NamedTuple):
    """The components, joined by sides or corners, of what stands in a room.

    Attributes
    ----------
    labels
        The number of each cell's part; 0 is none.
    boxes
        Shape (n + 1, 5), of each its x, y, columns, rows and cells.
    middles
        Shape (n + 1, 2), in cells.
    """

    labels: NDArray[np.int32]
    boxes: IntArray
    middles: FloatArray

    @classmethod
    def of(cls, room: Room) -> Parts:
        """Return the parts of what stands in a room."""
        _, labels, boxes, middles = cv2.connectedComponentsWithStats(room.inside, connectivity=8)
        return cls(
            np.asarray(labels, dtype=np.int32),
            np.asarray(boxes, dtype=np.int64),
            np.asarray(middles, dtype=np.float64) + 0.5,
        )

    @property
    def cells(self) -> IntArray:
        """How many cells each part has; of what is none of them, no cell counts."""
        counts = self.boxes[:, cv2.CC_STAT_AREA].copy()
        counts[0] = 0
        return counts

    def mask(self, k: int) -> Mask:
        """Return the cells of a part, cropped to its box."""
        x, y, columns, rows = self.boxes[k, :4].tolist()
        crop = self.labels[y : y + rows, x : x + columns] == k
        return np.asarray(crop, dtype=np.uint8)

    def spreads(self, which: IntArray) -> FloatArray:
        """Return how far parts' cells are from their middles, shape (k, 2, 2), squared."""
        if self._are_apart(which):
            found = [cv2.moments(self.mask(k), binaryImage=True) for k in which.tolist()]
            about = np.array([[m[name] for m in found] for name in ("mu20", "mu11", "mu02")])
        else:
            number = np.full(len(self.boxes), -1)
            number[which] = np.arange(len(which))
            cells = np.flatnonzero(self.labels > 0)
            of = number[self.labels.ravel()[cells]]
            cells, of = cells[of >= 0], of[of >= 0]
            y, x = np.divmod(cells, self.labels.shape[1])
            x, y = np.stack([x, y]) + 0.5 - self.middles[which].T[:, of]
            about = np.array([np.bincount(of, each, len(which)) for each in (x * x, x * y, y * y)])
        return np.reshape((about / self.cells[which])[[0, 1, 1, 2]].T, (-1, 2, 2))

    def _are_apart(self, which: IntArray) -> bool:
        """Whether parts' boxes are not more than the room, as those of what goes around others."""
        boxes = self.boxes[which]
        return bool((boxes[:, 2] * boxes[:, 3]).sum() <= self.labels.size)

    def outlines(self, which: Sequence[int]) -> _Geometries:
        """Return the outlines of some parts."""
        found: _Geometries = np.empty(len(which), dtype=object)
        if self._are_apart(np.array(which, dtype=np.int64)):
            for n, k in enumerate(which):
                found[n] = shapely.Polygon(outer_border(self.mask(k)) + self.boxes[k, :2])
            return found
        mask = (self.labels > 0).view(np.uint8)
        if len(which) < len(self.boxes) - 1:
            chosen = np.zeros(len(self.boxes), np.uint8)
            chosen[list(which)] = 1
            mask = chosen[self.labels]
        rings = {int(self.labels[at]): ring for at, ring in outlines(mask)}
        found[:] = [shapely.Polygon(rings[k]) for k in which]
        return found

    def cores(self, outlines: _Geometries, which: Sequence[int]) -> list[Core | None]:
        """Return where outlines are widest, if one has many corners."""
        if (shapely.get_num_coordinates(outlines) <= _CORNERS).all():
            return [None] * len(which)
        inside = self.labels > 0
        framed = cv2.copyMakeBorder(
            inside.view(np.uint8), 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=(0,)
        )
        distance = cv2.distanceTransform(framed, cv2.DIST_L2, cv2.DIST_MASK_5)
        part, away = self.labels[inside], distance[1:-1, 1:-1][inside]
        most = np.zeros(len(self.boxes), np.float32)
        np.maximum.at(most, part, away)
        at_most = away == most[part]
        spots = np.zeros((len(self.boxes), 2))
        y, x = np.divmod(np.flatnonzero(inside)[at_most], inside.shape[1])
        spots[part[at_most]] = np.stack([x, y], axis=1) + 0.5
        return [Core(float(_LONGER * most[k] + _ASIDE), *spots[k].tolist()) for k in which]


def as_they_are(room: Room, parts: Parts, least: float, most: int) -> list[Thing]:
    """Return each part of at least so many cells.

    Raises
    ------
    InvalidInputError
        With the path ``cells`` and the remedy, if there are more than ``most`` of them.
    """
    large = np.flatnonzero(parts.cells >= max(least, 1.0)).tolist()
    refuse_more(len(large), most, "raise min_size")
    outlines = parts.outlines(large)
    return [
        Thing(each, _certainty(each, room, core), core)
        for each, core in zip(outlines, parts.cores(outlines, large), strict=True)
    ]


def merged_within(
    room: Room, parts: Parts, least: float, distance: float, largest_leg: float
) -> list[Thing]:
    """Return the parts after small ones so near each other are one, of at least so many cells.

    Raises
    ------
    InvalidInputError
        With the path ``cells`` and the remedy, if there are too many.
    """
    count = len(parts.boxes) - 1
    refuse_more(count, _MOST_PARTS, "take speckle out of the map")
    if not count:
        return []
    outlines = parts.outlines(range(1, count + 1))
    found = merged(outlines, distance / room.cell, largest_leg)
    return [Thing(each, _certainty(each, room)) for each in found if each.area >= least]


def furnished(room: Room, parts: Parts, least: float, largest_leg: float, most: int) -> list[Thing]:
    """Return each part of at least so many cells, and the furniture of which a scan shows legs.

    Furniture covers no wall and nothing that is larger; what it covers belongs to it.

    Raises
    ------
    InvalidInputError
        As :func:`as_they_are` does.
    """
    things = as_they_are(room, parts, least, most)
    alone = dict(zip(np.flatnonzero(parts.cells >= max(least, 1.0)).tolist(), things, strict=True))

    def is_thing(members: IntArray) -> bool:
        return _is_furniture(members, alone, parts, least, room)

    sets = list(_sets(room, parts, largest_leg, list(alone), is_thing))
    if not sets:
        return things
    among = {k: n for n, (members, _) in enumerate(sets) for k in members.tolist()}
    which = sorted({*alone, *among})
    outlines = parts.outlines(which)
    number: dict[int, int] = {}
    group = np.array([number.setdefault(among.get(k, -1 - k), len(number)) for k in which])
    hulls, group = apart(outlines, group)
    certain = np.zeros(len(hulls))
    for k, n in zip(which, group.tolist(), strict=True):
        mine = sets[among[k]][1] if k in among else alone[k].certainty
        certain[n] = max(certain[n], mine)
    for k, n in zip(which, group.tolist(), strict=True):
        if k in among:
            certain[n] = min(certain[n], sets[among[k]][1])
    cores: list[Core | None] = [None] * len(hulls)
    count = np.bincount(group)
    for k, n in zip(which, group.tolist(), strict=True):
        if k in alone and count[n] == 1:
            cores[n] = alone[k].core
    return [Thing(*each) for each in zip(hulls, certain.tolist(), cores, strict=True)]


def _sets(
    room: Room,
    parts: Parts,
    largest_leg: float,
    alone: list[int],
    is_thing: Callable[[IntArray], bool],
) -> Iterator[tuple[IntArray, float]]:
    """Yield parts that belong together, none in two sets, and how sure it is that they do."""
    longer = parts.boxes[:, 2:4].max(axis=1) * room.cell
    met = np.bincount(parts.labels[room.occupied > 0], minlength=len(parts.cells))
    clump = (parts.cells > 0) & (parts.cells <= _CLUMP * largest_leg) & (longer <= FOOT)
    clump &= met >= _MET * parts.cells
    leg = clump & (parts.cells <= largest_leg)
    bar = leg & (longer >= _BAR)
    # What is so full is no bar, however it is turned.
    bar[alone] = parts.cells[alone] * _BAR_RATIO <= np.square(parts.boxes[alone, 2:4]).sum(axis=1)
    free = float(np.count_nonzero(room.free)) * room.cell**2

    def legs(which: IntArray) -> Legs:
        return Legs(parts.middles[which] * room.cell, free)

    small, many = np.flatnonzero(leg), np.flatnonzero(clump)
    crowded = np.zeros(len(clump), dtype=bool)
    found = [small[k] for k in tables(legs(small)) if is_thing(small[k])]
    for members in (many[k] for k in crowds(legs(many))):
        within = [each for each in found if np.isin(each, members).any()]
        if sum(map(len, within)) < _MOST * len(members) and is_thing(members):
            found = [each for each in found if not np.isin(each, members).any()]
            bar[members] = False
            crowded[members] = True
            yield members, _CROWD
    free_legs = np.setdiff1d(small[~crowded[small]], np.concatenate([small[:0], *found]))
    for members in _with_chairs(found, legs(free_legs), free_legs, parts, room.cell, is_thing):
        bar[members] = False
        yield members, _TABLE
    left = np.flatnonzero(bar)
    for pair in facing(_bars(left, parts, room.cell)):
        if is_thing(left[pair]):
            yield left[pair], _FACING


def _with_chairs(
    found: list[IntArray],
    legs: Legs,
    which: IntArray,
    parts: Parts,
    cell: float,
    is_thing: Callable[[IntArray], bool],
) -> list[IntArray]:
    """Return tables' parts with those of the chairs at them."""
    if not found or not which.size:
        return found
    hulls = [shapely.MultiPoint(cell * parts.middles[each]).convex_hull for each in found]
    more = list(found)
    for table, pair in chairs(legs, np.array(hulls, dtype=object)):
        together = np.union1d(more[table], which[pair])
        if is_thing(together):
            more[table] = together
    return more


def _bars(which: IntArray, parts: Parts, cell: float) -> Bars:
    """Return the rectangles with some parts' moments.

    A cell has a moment too, so that it hardly matters how a bar lies on the cells.
    """
    moments, along = np.linalg.eigh(parts.spreads(which) + np.eye(2) / 12.0)
    widths, lengths = cell * np.sqrt(12.0 * moments).T
    return Bars(cell * parts.middles[which], along[:, :, 1], lengths, widths)


def _is_furniture(
    members: IntArray, alone: dict[int, Thing], parts: Parts, least: float, room: Room
) -> bool:
    """Whether the hull of parts has some width, no walls in it, and covers nothing larger."""
    shapes = list(parts.outlines(members.tolist()))
    hull = cast(shapely.Polygon, shapely.GeometryCollection(shapes).convex_hull)
    others = (each.outline for k, each in alone.items() if k not in members)
    larger = (each for each in others if each.area > hull.area)
    return (
        hull.area >= least
        and not _is_thinner(hull, room.small)
        and not _meets_walls(hull, room)
        and not any(hull.intersects(each) for each in larger)
    )


def _meets_walls(hull: shapely.Polygon, room: Room) -> bool:
    """Whether a hull covers cells that are neither free nor of what stands in the room."""
    left, below, right, top = np.floor(hull.bounds).astype(int).tolist()
    window = np.s_[below : top + 1, left : right + 1]
    drawn = np.zeros(room.free[window].shape, np.uint8)
    ring = np.round(shapely.get_coordinates(hull) - (left, below) - 0.5).astype(np.int32)
    cv2.fillPoly(drawn, [ring], (1,))
    return bool((drawn > room.free[window] | room.inside[window]).any())


def at_the_walls(room: Room, things: list[Thing], bounds: Bounds) -> list[Thing]:
    """Return the things of a room together with those that stand at its walls."""
    thin = [each.outline for each in things if _is_thinner(each.outline, bounds.side, each.core)]
    outlines = [each.outline for each in things]
    tree = shapely.STRtree(outlines)
    parts_of_others, found = set(), []
    sides = shapely.union_all(_sides(thin, room, bounds))
    for pocket in at_walls(_walled(room), sides, bounds):
        polygon = _to_the_cell(pocket, bounds, room)
        near = tree.query(polygon, predicate="intersects").tolist()
        part = [k for k in near if _is_most_of(polygon.intersection(outlines[k]), outlines[k])]
        apart = shapely.union_all([outlines[k] for k in near if k not in part])
        left = shapely.get_parts(polygon.difference(apart)).tolist()
        polygon = max(left, key=shapely.area, default=shapely.Polygon())
        plain = cast(shapely.Polygon, polygon.simplify(0.5))
        kept = is_thick(plain, bounds.thinnest) and _seen(pocket.line, room) >= _seen_of(pocket)
        if kept and not any(_is_most_of(outlines[k], polygon) for k in part):
            parts_of_others.update(part)
            whole = shapely.Polygon(polygon.exterior)
            found += [Thing(each, _of_pocket(pocket)) for each in _without_walls(whole, bounds)]
    return [each for k, each in enumerate(things) if k not in parts_of_others] + found


def _without_walls(outline: shapely.Polygon, bounds: Bounds) -> list[shapely.Polygon]:
    """Return what is left of an outline without walls that end in it or run through it.

    These are as thin as walls and longer than twice that, and the rest is clearly thicker.
    """
    radius, long = bounds.thinnest / 2.0, 2.0 * bounds.thinnest
    opened = outline.buffer(-radius, join_style="mitre").buffer(radius + 1.0, join_style="mitre")
    thin = shapely.get_parts(outline.difference(opened))
    # Half the way around is its length and how thick it is.
    around = shapely.length(shapely.minimum_rotated_rectangle(thin)) / 2.0
    walls = thin[around > long + bounds.thinnest]
    if not walls.size:
        return [outline]
    least = max(bounds.thinnest, bounds.smallest) ** 2
    parts = shapely.get_parts(outline.difference(shapely.union_all(walls)))
    left = [shapely.Polygon(each.exterior) for each in parts[shapely.area(parts) > least]]
    clearly = all(is_thick(each, _CLEARLY * bounds.thinnest) for each in left)
    return left if left and clearly else [outline]


def _sides(thin: list[shapely.Polygon], room: Room, bounds: Bounds) -> list[shapely.Polygon]:
    """Return which thin things may be sides of what stands at a room's walls.

    One of many corners is none that is farther than a slit from the walls and all others, and
    leaves no slit in itself: it is a hole in the room, and not in its outline.
    """
    few = shapely.get_num_coordinates(thin) <= _CORNERS
    # Outlines along the cells grow by half of a slit, others by up to the limit of mitres.
    near = math.ceil(bounds.slit / 2.0)
    far = math.ceil(_MITRE * bounds.slit / 2.0 + bounds.stray) + 1
    if few.all() or far >= max(room.free.shape):
        return thin
    rows, columns = (side + 1 for side in room.free.shape)
    large, others = np.zeros((2, rows + 2 * far, columns + 2 * far), np.uint8)
    others[far : far + rows - 1, far : far + columns - 1] = room.free | room.inside
    others = 1 - others
    rings = [np.round(shapely.get_coordinates(each)).astype(np.int32) + far for each in thin]
    for ring, is_plain in zip(rings, few.tolist(), strict=True):
        cv2.fillPoly(others if is_plain else large, [ring], (1,))
    for mask, reach in ((large, near), (others, far)):
        cv2.dilate(mask, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8), dst=mask)
    # No more of them than rings, and so few.
    small = cv2.CV_16U if len(rings) < _MOST_FEW else cv2.CV_32S
    count, groups = cv2.connectedComponents(large, connectivity=8, ltype=small)
    kept = np.zeros(count, dtype=bool)
    kept[groups[(large & others) > 0]] = True
    contours, tree = cv2.findContours(large, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    for contour, (*_, parent) in zip(contours, tree[0], strict=True):
        if parent >= 0:
            kept[groups[tuple(contour[0, 0, ::-1])]] = True
    corners = [groups[tuple(ring[0, ::-1])] for ring in rings]
    return [
        each
        for each, at, is_plain in zip(thin, corners, few.tolist(), strict=True)
        if is_plain or kept[at]
    ]


def _to_the_cell(pocket: Pocket, bounds: Bounds, room: Room) -> shapely.Polygon:
    """Return the outline of the cells that a simplified pocket stands for.

    These are its own and those around it that it may have left out, but not beyond the walls.
    """
    shape, stray = pocket.outline, bounds.stray
    left, below, right, top = np.floor(shape.buffer(stray).bounds).astype(int).tolist()
    taken = 1 - _window(room.free, left, below, right, top)
    y, x = np.nonzero(taken)
    spots = np.asarray(shapely.points(x + left + 0.5, y + below + 0.5), dtype=object)
    # A pocket lies right of its line.
    line = shapely.get_coordinates(shape)[len(pocket.line) - 1 :]
    beyond = np.zeros(len(x), dtype=bool)
    for (x0, y0), (x1, y1) in itertools.pairwise(line.tolist()):
        beyond |= (x1 - x0) * (y + below + 0.5 - y0) - (y1 - y0) * (x + left + 0.5 - x0) > 0.0
    shapely.prepare(shape)
    kept = shapely.distance(shape, spots) <= np.where(beyond, 0.0, stray)
    taken[y[~kept], x[~kept]] = 0
    filled = closed(taken, round(bounds.slit))
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(filled, connectivity=8)
    if len(boxes) == 1:
        return shape
    largest = labels == 1 + int(boxes[1:, cv2.CC_STAT_AREA].argmax())
    corner = np.array([left, below])
    return shapely.Polygon(outer_border(largest.astype(np.uint8)) + corner)


def _window(mask: Mask, left: int, below: int, right: int, top: int) -> Mask:
    """Return the cells of a mask from (left, below) to (right, top), 0 where it has none."""
    rows, columns = mask.shape
    inside = mask[max(below, 0) : top + 1, max(left, 0) : right + 1]
    beyond = (max(-below, 0), max(top + 1 - rows, 0)), (max(-left, 0), max(right + 1 - columns, 0))
    return np.pad(inside, beyond)


def _is_most_of(part: shapely.Polygon, whole: shapely.Polygon) -> bool:
    return bool(part.area > _MOST * whole.area)


def _seen_of(pocket: Pocket) -> float:
    return _SEEN_IN_A_CORNER if pocket.leans is Leans.IN_A_CORNER else _SEEN


def _of_pocket(pocket: Pocket) -> float:
    if pocket.leans is Leans.NOT:
        return _HANGING
    if pocket.leans is Leans.IN_A_CORNER:
        return _CORNER
    return _JUTTING if pocket.depth >= pocket.neck else _LEANING


def _walled(room: Room) -> shapely.Polygon:
    """Return a room's outline along the middles of the walls' cells.

    So that a corner joins two of them, as it does not two free cells.
    """
    walls = cv2.copyMakeBorder(
        1 - (room.free | room.inside), 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=(1,)
    )
    contours, tree = cv2.findContours(walls, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    rings = [ring for ring, (*_, parent) in zip(contours, tree[0], strict=True) if parent >= 0]
    ring = max(rings, key=cv2.contourArea)[:, 0, :].astype(np.float64) - 0.5
    return shapely.Polygon(ring)


def _certainty(polygon: shapely.Polygon, room: Room, core: Core | None = None) -> float:
    """Return how sure it is that an outline is a thing, and no shadow of one and no speckle."""
    sure = min(1.0, _seen(shapely.get_coordinates(polygon), room) / _SEEN)
    compact = not _is_thinner(polygon, room.small, core)
    speck = polygon.area < (_SPECK * room.small) ** 2
    at_edge = (speck or not compact) and _is_at_an_unseen_edge(polygon, room)
    if speck and [compact, not at_edge, sure == 1.0].count(False) > 1:
        return min(sure, _SHADOW)
    if compact:
        return max(sure, _COMPACT)
    ragged = polygon.area < _STRAIGHT * polygon.convex_hull.area
    return min(sure, _RAGGED) if at_edge or ragged else sure


def _is_thinner(polygon: shapely.Polygon, width: float, core: Core | None = None) -> bool:
    """Whether a polygon in cells is nowhere so wide."""
    radius = width / 2.0
    # A disc of the area through the perimeter fits into anything, by Bonnesen.
    if polygon.area >= radius * polygon.length:
        return False
    if core is not None and core.widest < radius:
        return True
    # Of stairs along the cells every step would count.
    plain = simplified(polygon, 0.5)
    if core is not None and _holds_disc_near(plain, radius, core):
        return False
    return not _holds_disc(plain, radius)


def _holds_disc_near(polygon: shapely.Polygon, radius: float, core: Core) -> bool:
    """Whether a disc lies in the part of a polygon around where it is widest."""
    reach = 1.1 * radius + _ASIDE
    window = (core.x - reach, core.y - reach, core.x + reach, core.y + reach)
    return not shapely.is_empty(shapely.buffer(shapely.clip_by_rect(polygon, *window), -radius))


def _holds_disc(polygon: shapely.Polygon, radius: float) -> bool:
    """Whether a disc lies in a polygon, looked for in pieces of few corners each."""
    if shapely.get_num_coordinates(polygon) <= _CORNERS:
        return not polygon.buffer(-radius).is_empty
    return any(_is_so_wide(piece, radius) for piece in _pieces(polygon, radius))


def _pieces(polygon: shapely.Polygon, radius: float) -> Iterator[shapely.Polygon]:
    """Yield pieces of a polygon; where a disc lies in it, it lies in one of them."""
    low, high = np.reshape(polygon.bounds, (2, 2))
    axis = int((high - low).argmax())
    middle = (low[axis] + high[axis]) / 2.0
    # Half of the middles of discs lie on either side, and of discs a little more.
    reach = 1.1 * radius
    if shapely.get_num_coordinates(polygon) <= _CORNERS or high[axis] - middle <= 2.0 * reach:
        yield polygon
        return
    for side, end in ((1, middle + reach), (0, middle - reach)):
        box = np.array([low, high])
        box[side, axis] = end
        for part in shapely.get_parts(shapely.clip_by_rect(polygon, *box.ravel())).tolist():
            yield from _pieces(part, radius)


def _is_so_wide(piece: shapely.Polygon, radius: float) -> bool:
    """Whether a disc lies in a piece; most have fewer corners without stairs, and then none."""
    rough = piece.simplify(_ROUGH) if radius > _ROUGH else piece
    more = rough.buffer(_ROUGH - radius)
    return not more.is_empty and not piece.buffer(-radius).is_empty


def _is_at_an_unseen_edge(polygon: shapely.Polygon, room: Room) -> bool:
    """Whether what the laser did not see begins near something, and no wall between."""
    reach = min(round(_NEAR * room.small), max(room.free.shape))
    left, below, right, top = np.floor(polygon.bounds).astype(int).tolist()
    window = np.s_[max(below - reach, 0) : top + reach, max(left - reach, 0) : right + reach]
    unseen = 1 - (room.free[window] | room.inside[window] | room.occupied[window])
    beside = cv2.dilate(unseen, _SIDES) > 0
    return bool(np.count_nonzero(beside & (room.free[window] > 0)) > _EDGE * room.small)


def _seen(line: FloatArray, room: Room) -> float:
    """Return along which share of a line, in cells, the laser met something."""
    until = np.concatenate([[0.0], np.hypot(*np.diff(line, axis=0).T).cumsum()])
    steps = np.arange(0.25, until[-1], 0.5)
    xy = [np.interp(steps, until, each) for each in line.T]
    points = np.floor(np.stack(xy, axis=1)).astype(int)
    x, y = np.clip(points, 0, np.array(room.met.shape)[::-1] - 1).T
    return float(room.met[y, x].mean())
