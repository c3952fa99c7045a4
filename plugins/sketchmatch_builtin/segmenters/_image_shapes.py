"""From ink to the shapes that it fills or encloses."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np

from sketchmatch.api import InvalidInputError, Reason
from sketchmatch_builtin.segmenters._image_drawing import Drawing, Shape, without_specks
from sketchmatch_builtin.segmenters._image_light import Mask
from sketchmatch_builtin.segmenters._strokes_marks import typical_span
from sketchmatch_builtin.segmenters._writing import written

__all__ = ["MOST_SHAPES", "Tracing", "closed_beside", "trace"]

MOST_SHAPES = 1000
"""A picture with more shapes is noise, and refused before they are looked at."""

# Pixels along the larger side at which gaps are closed.
_GAP_SIDE = 640
# A shape is whole if what is left of it without its lines spans, and fills, these shares of it.
_WHOLE = 0.5
_FULL = 0.15
# Closed from several pieces and smaller than this share of the other shapes, it is handwriting.
_WRITING = 0.15
# Faces of a drawing belong to one object if together they fill this share of their convex hull.
_CONVEX = 0.88
_MOST_FACES = 10
# Faces stick out of a group if the dents that they add are larger than this share of them.
_STICKS_OUT = 0.5
# A group costs 1 and the share of its hull that are dents; a face in two groups, where objects
# overlap, saves this.
_SHARED = 0.01


@dataclass
class Tracing:
    """What was found, and what had to be decided on the way."""

    shapes: list[Shape] = field(default_factory=list)
    framed: bool = False
    rooms: int = 0
    attached: int = 0
    closed: int = 0
    parted: int = 0
    divided: int = 0
    written: int = 0
    open_lines: int = 0


def trace(ink: Mask, least: float, gap: float, frames: bool) -> Tracing:
    """Trace each shape around its outside [1]_, so that an outline counts as what it encloses.

    Parameters
    ----------
    ink
        Shape (rows, columns), 1 on ink.
    least
        Pixels that a shape has at least.
    gap
        Largest gap in an outline, as a share of the outline's size.
    frames
        Whether one shape around at least two others is left out.

    Raises
    ------
    InvalidInputError
        With the path ``pixels``, if there are more than :data:`MOST_SHAPES` shapes.

    References
    ----------
    .. [1] S. Suzuki, K. Abe, "Topological structural analysis of digitized binary images by
       border following", Computer Vision, Graphics, and Image Processing 30(1), 1985.
    """
    found = Tracing()
    drawing = Drawing(without_specks(ink, math.sqrt(least)), least)
    shapes = drawing.outermost()
    attached: list[int] = []
    while frames:
        frame = drawing.frame(shapes)
        around = drawing.room(shapes) if frame is None else frame
        if around is None:
            break
        attached += drawing.drawn_against(around)
        shapes = [shape for shape in shapes if shape != around] + drawing.inside(around)
        found.framed |= frame is not None
        found.rooms += frame is None
    if len(shapes) > MOST_SHAPES:
        raise InvalidInputError(
            Reason.LIMIT_EXCEEDED,
            "pixels",
            f"has {len(shapes)} shapes, more than the limit of {MOST_SHAPES}; raise blur or "
            "min_size",
        )
    pen = drawing.pen()
    radius = 1 + math.ceil(1.2 * pen) if pen else 0
    for hole in attached:
        found.shapes.append(_widened(drawing.filled(hole), max(1, round(pen))))
        found.attached += 1
    whole = [k for k in shapes if not radius or _is_whole(drawing.filled(k).mask, radius, least)]
    writing = _writing(drawing, drawing.beside(shapes), whole)
    found.written, known = len(writing.intersection(whole)), writing.union(whole)
    lines = [shape for shape in shapes if shape not in known]
    for shape in (each for each in whole if each not in writing):
        parts, faces = _parts(drawing.ink_of(shape), drawing.filled(shape), radius, least)
        found.parted += len(parts) > 1
        found.divided += len(parts) == 1 and faces > 1
        found.shapes.extend(parts)
    if not radius:
        return found
    loose = drawing.loose(shapes, lines, writing)
    open_frame: Shape | None = None

    def inside(part: Shape) -> list[Shape]:
        return [other for other in found.shapes if _covers(part, _box(other))]

    def is_frame(part: Shape) -> bool:
        return frames and len(inside(part)) >= 2

    for part, pieces, framed in _closed_outlines(loose, gap, radius, least, is_frame):
        if framed:
            found.framed, open_frame = True, part
            continue
        within = inside(part)
        if pieces > 1 and _is_writing(part, found.shapes):
            continue
        found.shapes = [other for other in found.shapes if all(other is not w for w in within)]
        found.shapes.append(part)
        found.closed += 1
    for shape in lines:
        if any(_covers(part, drawing.box(shape)) for part in found.shapes):
            continue
        if open_frame and drawing.box(shape)[2] > 0.8 * open_frame.mask.shape[1]:
            continue
        rest = _opened(drawing.filled(shape), radius, least)
        found.open_lines += not rest
        # Where a line passes through a shape with gaps, that was closed before.
        before = [*found.shapes]
        found.shapes += [each for each in rest if not any(_overlap(each, one) for one in before)]
    return found


def closed_beside(ink: Mask, shapes: list[Shape], least: float) -> int:
    """Return how many shapes ink fills or encloses beside those that were found."""
    drawing = Drawing(without_specks(ink, math.sqrt(least)), least)
    others = drawing.outermost()
    pen = drawing.pen()
    radius = 1 + math.ceil(1.2 * pen)
    count = 0
    for other in (drawing.filled(k) for k in others[:MOST_SHAPES]):
        beside = not any(_overlap(other, one) or _overlap(one, other) for one in shapes)
        count += beside and _is_whole(other.mask, radius, least)
    return count


def _writing(drawing: Drawing, shapes: list[int], whole: list[int]) -> frozenset[int]:
    """Return which shapes of a drawing are writing beside its objects."""
    if len(shapes) > MOST_SHAPES:
        return frozenset()
    boxes = np.array([drawing.box(shape) for shape in shapes]).reshape(-1, 4)
    corners = [np.array([(x, y), (x + w, y + h)], float) for x, y, w, h in boxes.tolist()]
    known = set(whole)
    spans = [max(drawing.box(shape)[2:]) for shape in whole]
    found = written(corners, [k in known for k in shapes], typical_span(spans))
    which = frozenset(shapes[k] for k in found)
    # A match needs two.
    return which if len(known - which) > 1 else frozenset()


def _disk(radius: int) -> Mask:
    size = (2 * radius + 1, 2 * radius + 1)
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, size), np.uint8)


def _core(mask: Mask, radius: int) -> Mask:
    """Return a mask without what is thinner than a disk: opening by it."""
    padded = cv2.copyMakeBorder(mask, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    core = cv2.morphologyEx(padded, cv2.MORPH_OPEN, _disk(radius))
    return np.asarray(core, np.uint8)[1:-1, 1:-1]


def _hull_area(mask: Mask) -> float:
    points = cv2.findNonZero(mask)
    return float(cv2.contourArea(cv2.convexHull(points))) if points is not None else 0.0


def _is_whole(mask: Mask, radius: int, least: float) -> bool:
    core, span = _core(mask, radius), _hull_area(mask)
    enough = int(core.sum()) >= max(0.5 * least, _FULL * span)
    return enough and _hull_area(core) >= _WHOLE * span


def _opened(shape: Shape, radius: int, least: float) -> list[Shape]:
    """Return the large pieces of a shape without the lines that stick out or connect them."""
    core = _core(shape.mask, radius)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(core, connectivity=4)
    areas = stats[1:, cv2.CC_STAT_AREA]
    large = 1 + np.flatnonzero(areas >= max(0.5 * least, 0.1 * areas.max(initial=0)))
    pieces = []
    for label in large:
        piece = np.asarray(labels == label, np.uint8)
        # Opening rounds corners: what is near is given back, and the stub of a line with it.
        near = np.asarray(cv2.dilate(piece, _disk(max(1, radius // 2))), np.uint8)
        for other in large[large != label]:
            near[labels == other] = 0
        pieces.append(_cropped(near & shape.mask, shape.corner))
    return pieces


def _cropped(mask: Mask, corner: tuple[int, int]) -> Shape:
    """Return the largest piece of a mask, without holes."""
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    largest = max(contours, key=cv2.contourArea)
    x, y, width, height = cv2.boundingRect(largest)
    piece = np.zeros((height, width), np.uint8)
    cv2.drawContours(piece, [largest], 0, 1, cv2.FILLED, offset=(-x, -y))
    return Shape(piece, (corner[0] + x, corner[1] + y))


def _covers(shape: Shape, box: tuple[int, int, int, int]) -> bool:
    """Return whether the middle of a box, or most of it, lies within a shape's box."""
    x, y, width, height = box
    rows, columns = shape.mask.shape
    left, top = shape.corner
    wide = min(x + width, left + columns) - max(x, left)
    high = min(y + height, top + rows) - max(y, top)
    return bool(wide > 0 and high > 0 and wide * high >= 0.6 * width * height)


def _overlap(shape: Shape, other: Shape) -> bool:
    """Return whether half of a shape lies in another one."""
    (x, y), (u, v) = shape.corner, other.corner
    (rows, columns), (height, width) = shape.mask.shape, other.mask.shape
    low, high = (max(x, u), max(y, v)), (min(x + columns, u + width), min(y + rows, v + height))
    if low[0] >= high[0] or low[1] >= high[1]:
        return False
    mine = shape.mask[low[1] - y : high[1] - y, low[0] - x : high[0] - x]
    its = other.mask[low[1] - v : high[1] - v, low[0] - u : high[0] - u]
    return bool(2 * np.count_nonzero(mine & its) >= np.count_nonzero(shape.mask))


def _box(shape: Shape) -> tuple[int, int, int, int]:
    return (*shape.corner, shape.mask.shape[1], shape.mask.shape[0])


def _widened(shape: Shape, reach: int) -> Shape:
    wide = np.asarray(cv2.dilate(np.pad(shape.mask, reach), _disk(reach)), np.uint8)
    return Shape(wide, (shape.corner[0] - reach, shape.corner[1] - reach))


def _is_writing(shape: Shape, others: list[Shape]) -> bool:
    areas = [float(other.mask.sum()) for other in others]
    return len(areas) >= 2 and float(shape.mask.sum()) < _WRITING * float(np.median(areas))


# Outlines with gaps


def _closed_outlines(
    ink: Mask, gap: float, radius: int, least: float, is_frame: Callable[[Shape], bool]
) -> Iterator[tuple[Shape, int, bool]]:
    """Yield the shapes that open outlines enclose once gaps are closed, small gaps first.

    With each comes the number of pieces that it was drawn with, and whether it is a frame. What
    lies in a shape belongs to it, unless it is a frame.
    """
    if gap == 0.0 or not ink.any():
        return
    share = min(1.0, _GAP_SIDE / max(ink.shape))
    small = ink
    if share < 1.0:
        size = tuple(max(1, math.ceil(share * length)) for length in ink.shape[::-1])
        area = cv2.resize(ink * 255, size, interpolation=cv2.INTER_AREA)
        small = np.asarray(np.asarray(area) > 40, np.uint8)
    radius = max(1, round(share * radius))
    largest = gap * max(ink.shape) * share
    reach = 1
    while 2 * reach <= largest + 2 and small.any():
        margin = reach + 2
        wide = np.pad(small, margin)
        grown = np.asarray(cv2.dilate(wide, _disk(reach)), np.uint8)
        for contour in _largest_first(grown):
            x, y, width, height = cv2.boundingRect(contour)
            part = wide[y : y + height, x : x + width]
            if not part.any():
                continue
            filled = np.zeros((height + 2, width + 2), np.uint8)
            cv2.drawContours(filled, [contour], 0, 1, cv2.FILLED, offset=(1 - x, 1 - y))
            back = np.asarray(cv2.erode(filled, _disk(reach)), np.uint8)
            span = math.hypot(width, height)
            if 2 * reach > gap * span + 2 or back.sum() < share**2 * least:
                continue
            if not _is_whole(back, max(radius, 1), 2.0 * share**2 * least):
                continue
            pieces = _opened(Shape(back, (x - 1 - margin, y - 1 - margin)), radius, 0.0)
            piece = max(pieces, key=lambda part: int(part.mask.sum()))
            taken = filled[1:-1, 1:-1] > 0
            shape = _enlarged(piece, ink.shape[1] / small.shape[1], ink.shape[0] / small.shape[0])
            framed = is_frame(shape)
            if framed:
                within = grown[y : y + height, x : x + width]
                numbers = np.asarray(cv2.connectedComponents(within)[1])
                column, row = contour[0, 0] - (x, y)
                taken = numbers == numbers[row, column]
            drawn = cv2.connectedComponents(np.where(taken, part, 0).astype(np.uint8))[0] - 1
            yield shape, drawn, framed
            part[taken] = 0
        small = np.ascontiguousarray(wide[margin:-margin, margin:-margin])
        reach += max(1, reach // 3)


def _largest_first(mask: Mask) -> list[Any]:
    """Return the outer contours of a mask's pieces, also of those within others."""
    contours, hierarchy = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    parents = np.asarray(hierarchy)[0, :, 3] if contours else ()
    outer = [each for each, parent in zip(contours, parents, strict=True) if parent < 0]
    return sorted(outer, key=lambda each: math.prod(cv2.boundingRect(each)[2:]), reverse=True)


def _enlarged(shape: Shape, along_x: float, along_y: float) -> Shape:
    if along_x == 1.0 and along_y == 1.0:
        return shape
    padded = cv2.copyMakeBorder(shape.mask * 255, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    size = (round(padded.shape[1] * along_x), round(padded.shape[0] * along_y))
    mask = np.asarray(cv2.resize(padded, size, interpolation=cv2.INTER_LINEAR)) > 127
    corner = (round((shape.corner[0] - 1) * along_x), round((shape.corner[1] - 1) * along_y))
    return _cropped(np.asarray(mask, np.uint8), corner)


# Drawings that touch or overlap


def _parts(ink: Mask, whole: Shape, radius: int, least: float) -> tuple[list[Shape], int]:
    """Return a shape, or the shapes that it is drawn of where they touch or overlap.

    The fewest convex groups of faces that cover it are taken, so that lines within a convex shape
    part nothing. With them comes the number of faces at its outside.
    """
    if not radius:
        return [whole], 0
    core = _core(whole.mask, radius)
    faces = _faces(ink & whole.mask, whole.mask, core, least)
    outside = cv2.erode(np.pad(whole.mask, 1), _disk(radius))[1:-1, 1:-1] == 0
    outer = sum(bool(face[outside].any()) for face in faces)
    groups = _fewest_convex(faces, radius) if 2 <= len(faces) <= _MOST_FACES else []
    if len(groups) > 1:
        return [_cropped(group & whole.mask, whole.corner) for group in groups], outer
    near = np.asarray(cv2.dilate(core, _disk(radius)), np.uint8)
    if (whole.mask & ~near).any() or _pieces(core) > 1:
        return _opened(whole, radius, least) or [whole], outer
    return [whole], outer


def _pieces(mask: Mask) -> int:
    return int(cv2.connectedComponents(mask, connectivity=4)[0]) - 1


def _faces(ink: Mask, filled: Mask, core: Mask, least: float) -> list[Mask]:
    blank = np.asarray(filled & (1 - ink), np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(blank, connectivity=4)
    areas = stats[:, cv2.CC_STAT_AREA]
    enough = max(0.02 * float(core.sum()), 0.25 * least)
    large = [k for k in range(1, count) if areas[k] >= enough]
    return [np.asarray(labels == k, np.uint8) for k in large]


def _fewest_convex(faces: list[Mask], radius: int) -> list[Mask]:
    """Return the fewest groups of faces, each nearly convex, that cover all; none if there are."""
    groups = _Groups(faces, radius)
    everything = (1 << len(faces)) - 1
    if groups.cost(everything) < math.inf:
        return [groups.mask(everything)]
    costs = {group: groups.cost(group) for group in range(1, everything)}
    found = _cover({group: cost for group, cost in costs.items() if cost < math.inf}, len(faces))
    return [groups.mask(group) for group in found]


class _Groups:
    """Groups of faces, as bits of a number, and how convex each is.

    A group's dents are what its convex hull has besides [1]_. No part of a convex group sticks out
    of it, as a chair does of a table of at least twice its width: it adds dents of half its size.

    References
    ----------
    .. [1] D. D. Hoffman, W. A. Richards, "Parts of recognition", Cognition 18, 1984: shapes are
       parted where they are concave.
    """

    def __init__(self, faces: list[Mask], radius: int) -> None:
        line = _disk(radius)
        self._wide = [np.asarray(cv2.dilate(np.pad(f, radius), line), np.uint8) for f in faces]
        outlines = [
            cv2.findContours(f, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)[0] for f in self._wide
        ]
        self._hulls = [cv2.convexHull(np.concatenate(contours)) for contours in outlines]
        self._shared = [
            [int(np.count_nonzero(f & other)) for other in self._wide] for f in self._wide
        ]
        self._thick = sum(1 << k for k, face in enumerate(faces) if _core(face, radius).any())
        self._sizes = [int(face.sum()) for face in faces]
        self._radius = radius
        self._measured: dict[int, tuple[float, float]] = {}

    def mask(self, group: int) -> Mask:
        """Return a group's faces and the lines between them."""
        union = np.bitwise_or.reduce([self._wide[k] for k in self._members(group)])
        back, inner = _disk(max(1, self._radius // 2)), slice(self._radius, -self._radius)
        return np.asarray(cv2.erode(union, back), np.uint8)[inner, inner]

    def cost(self, group: int) -> float:
        """Return 1 and the share of a group's hull that are dents; infinite if it is not convex."""
        area, dents = self._measure(group)
        share = dents / max(area + dents, 1.0)
        convex = share <= 1.0 - _CONVEX and self._connected(group) and not self._sticks_out(group)
        return 1.0 + share if convex else math.inf

    def _members(self, group: int) -> list[int]:
        return [k for k in range(len(self._wide)) if group >> k & 1]

    def _measure(self, group: int) -> tuple[float, float]:
        """Return the area of a group with its lines, and that of its dents."""
        if group not in self._measured:
            members = self._members(group)
            pairs = itertools.combinations(members, 2)
            area = sum(self._shared[k][k] for k in members)
            area -= sum(self._shared[one][other] for one, other in pairs)
            hull = cv2.convexHull(np.concatenate([self._hulls[k] for k in members]))
            self._measured[group] = float(area), max(0.0, cv2.contourArea(hull) - area)
        return self._measured[group]

    def _sticks_out(self, group: int) -> bool:
        dents = self._measure(group)[1]
        if dents <= _STICKS_OUT * min(self._sizes[k] for k in self._members(group)):
            return False
        part = (group - 1) & group
        while part:
            size = sum(self._sizes[k] for k in self._members(part))
            added = dents - self._measure(group ^ part)[1] if dents > _STICKS_OUT * size else 0.0
            if part & self._thick and added > _STICKS_OUT * size:
                return True
            part = (part - 1) & group
        return False

    def _connected(self, group: int) -> bool:
        members = self._members(group)
        reached = [members[0]]
        for one in reached:
            reached += [k for k in members if k not in reached and self._shared[one][k]]
        return len(reached) == len(members)


def _cover(costs: dict[int, float], faces: int) -> list[int]:
    """Return the groups of least cost that cover all faces."""
    choices = [[group for group in costs if group >> k & 1] for k in range(faces)]
    order = sorted(range(faces), key=lambda k: len(choices[k]))
    best: tuple[float, list[int]] = (math.inf, [])

    def extend(taken: int, groups: list[int], cost: float) -> None:
        nonlocal best
        left = next((k for k in order if not taken >> k & 1), None)
        if left is None:
            best = min(best, (cost, groups), key=lambda cover: cover[0])
        elif cost + 1.0 - _SHARED * faces < best[0]:
            for group in choices[left]:
                saved = _SHARED * (group & taken).bit_count()
                extend(taken | group, [*groups, group], cost + costs[group] - saved)

    extend(0, [], 0.0)
    return best[1]
