"""Drawn floor plans as cells: what lies between walls is free, whoever drew them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Container, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from sketchmatch.api import InvalidInputError, Reason
from sketchmatch.model import FloatArray, Image, PolygonSet, StrokeSet
from sketchmatch_builtin.segmenters._cells import Mask
from sketchmatch_builtin.segmenters._doorways import divided, doorway, widths
from sketchmatch_builtin.segmenters._plan_things import seen
from sketchmatch_builtin.segmenters._swings import doors_apart

__all__ = ["Plan", "drawn", "lines_of"]

# Cells along the longer side of what lines are drawn into, or a picture is made smaller to.
_SIDE = 1000
# Around a plan there is free space, this share of its longer side wide.
_MARGIN = 0.1
# Shades of a picture that are nearer to each other are of one thing.
_CONTRAST = 32.0
# Of a door's length: what is narrower is the inside of a wall.
_WALL = 0.5
# Beyond these, coordinates are a fault, and areas would overflow or vanish.
_SMALLEST, _LARGEST = 1e-100, 1e15


@dataclass(frozen=True)
class Plan:
    """Free cells of a drawn plan, row 0 the lowest, all that is outside the building left out.

    Attributes
    ----------
    free
        1 where a cell is free, in a frame of cells that are not, while all doors are closed.
    doors
        1 where doors that are drawn close, and a cell is free while they are open.
    cell
        Side of a cell in the drawing's unit.
    corner
        (x, y) of the lower left corner of cell (0, 0), in the drawing's unit.
    door
        Up to how wide a passage is a doorway, in cells.
    """

    free: Mask
    doors: Mask
    cell: float
    corner: tuple[float, float]
    door: float


def drawn(
    source: StrokeSet | PolygonSet | Image,
    door_width: float | None,
    *,
    left_out: Container[int] = (),
    side: int = _SIDE,
) -> Plan:
    """Return the free cells of a drawn plan.

    Parameters
    ----------
    source
        Strokes, lines and outlines that are walls, or a picture of free space and walls, of which
        either is darker.
    door_width
        Widest doorway in the drawing's unit, or None to find it from the drawing.
    left_out
        Which strokes are no walls.
    side
        Cells along the longer side of what lines are drawn into.
    """
    leaf = 0.0
    if isinstance(source, Image):
        walls, cell, corner = _of_picture(source)
        closed = np.zeros_like(walls)
    else:
        given = lines_of(source)
        if isinstance(source, StrokeSet):
            given = seen([each for k, each in enumerate(source.strokes) if k not in left_out])
        lines, leaves = doors_apart(given)
        (walls, closed), cell, corner = _of_lines((lines, leaves), side)
        if leaves:
            leaf = float(np.median([np.linalg.norm(end - hinge) for hinge, end in leaves])) / cell
    door = None if door_width is None else door_width / cell
    free, width = _between(walls | closed, door)
    if leaf:
        free |= _behind_doors(walls, closed, leaf)
    # Walls have less room between their borders than what lies between them.
    if isinstance(source, Image) and np.count_nonzero(walls) > np.count_nonzero(free):
        free, width = walls, doorway(walls, math.inf) if door is None else door
    return Plan(free, closed & (1 - walls), cell, corner, width)


def lines_of(source: StrokeSet | PolygonSet) -> list[FloatArray]:
    """Return lines that are walls, each of shape (k, 2)."""
    if isinstance(source, StrokeSet):
        lines, path = [stroke.points for stroke in source.strokes], "strokes"
    else:
        rings = [ring for polygon in source.polygons for ring in polygon.rings]
        closed = [np.concatenate([ring, ring[:1]]) for ring in rings if len(ring)]
        lines, path = [*source.lines, *closed], "polygons"
    points = np.concatenate([np.zeros((0, 2)), *lines])
    if not len(points) or not (np.abs(points) < _LARGEST).all():
        what = "hold no point" if not len(points) else "hold a point that is not finite"
        raise InvalidInputError(Reason.TOO_FEW_OBJECTS, path, f"{what}; draw the walls of rooms")
    span = float(np.ptp(points, axis=0).max())
    if 0.0 < span < _SMALLEST:
        raise InvalidInputError(
            Reason.TOO_FEW_OBJECTS, path, f"are {span:g} units wide; draw them in a usual unit"
        )
    return lines


def _of_lines(
    layers: Sequence[Sequence[FloatArray]], side: int
) -> tuple[list[Mask], float, tuple[float, float]]:
    """Return the cells that lines of each layer go through, in free space all around."""
    points = np.concatenate([*itertools.chain(*layers)])
    low, size = points.min(axis=0), np.ptp(points, axis=0)
    cell = float(size.max()) / side or 1.0
    margin = round(_MARGIN * side)
    columns, rows = (np.ceil(size / cell).astype(int) + 2 * margin + 1).tolist()
    masks = []
    for lines in layers:
        mask = np.zeros((rows, columns), np.uint8)
        corners = [np.floor((line - low) / cell).astype(np.int32) + margin for line in lines]
        cv2.polylines(mask, corners, False, (1,), thickness=2)
        masks.append(mask)
    return masks, cell, (float(low[0]) - margin * cell, float(low[1]) - margin * cell)


def _of_picture(source: Image) -> tuple[Mask, float, tuple[float, float]]:
    """Return the cells that are not of the shade along the picture's border, in a margin."""
    grey = source.pixels
    if grey.ndim == 3:
        grey = np.asarray(cv2.cvtColor(grey, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    rows, columns = grey.shape
    scale = max(max(rows, columns) / _SIDE, 1.0)
    if scale > 1.0:
        side = (max(round(columns / scale), 1), max(round(rows / scale), 1))
        grey = np.asarray(cv2.resize(grey, side, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    if float(np.ptp(grey)) < _CONTRAST:
        raise InvalidInputError(
            Reason.TOO_FEW_OBJECTS, "pixels", "is of one shade; give a picture of rooms and walls"
        )
    _, light = cv2.threshold(grey[::-1], 0, 1, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    border = np.concatenate([light[0], light[-1], light[:, 0], light[:, -1]])
    margin = round(_MARGIN * max(grey.shape))
    figure = np.pad(light.astype(np.uint8) ^ np.uint8(border.mean() > 0.5), margin)
    return figure, scale, (-margin * scale, -margin * scale)


def _between(walls: Mask, door: float | None) -> tuple[Mask, float]:
    """Return the cells between walls, without what is outside, and how wide a doorway is.

    Outside is what joins the border through whatever is wider than a doorway: the outer wall may
    have doors, too. How wide these are is found from what lies within the hull of the walls, and
    then from what lies behind doorways.
    """
    free = 1 - walls
    inside = _hull(walls) & free
    for _ in range(2 if door is None else 1):
        width = door or (doorway(inside, math.inf) if inside.any() else 1.0)
        # Outside is wider than any doorway, and joins no hall through the door of a building.
        around = math.ceil(width)
        parts = divided(np.pad(free, around, constant_values=1), width, width**2 / 2.0)
        inside = _off_border(parts)[around:-around, around:-around] & free
    # What was cut within the building is joined again, to be cut once for all sources.
    reach = np.ones((5, 5), np.uint8)
    return np.asarray(cv2.dilate(inside, reach), dtype=np.uint8) & free, width


def _behind_doors(walls: Mask, closed: Mask, leaf: float) -> Mask:
    """Return the closed spaces that doors of a length lead into, and are no insides of walls.

    Beside halls, whose typical width tells how wide a doorway is, a corridor may be no wider.
    """
    inside = _off_border(1 - (walls | closed))
    count, found = cv2.connectedComponents(inside, connectivity=4)
    spaces = np.asarray(found, dtype=np.int32)
    widest = np.zeros(count, np.float32)
    np.maximum.at(widest, spaces.reshape(-1), widths(inside).reshape(-1))
    entered = np.zeros(count, np.bool_)
    entered[spaces[cv2.dilate(closed, np.ones((5, 5), np.uint8)) > 0]] = True
    entered[0] = False
    return np.asarray((entered & (2.0 * widest >= _WALL * leaf))[spaces], dtype=np.uint8)


def _hull(mask: Mask) -> Mask:
    filled = np.zeros(mask.shape, np.uint8)
    if mask.any():
        cv2.fillConvexPoly(filled, cv2.convexHull(cv2.findNonZero(mask)), (1,))
    return filled


def _off_border(mask: Mask) -> Mask:
    """Return a mask's components that do not reach its border."""
    framed = np.pad(mask, 1, constant_values=1)
    cv2.floodFill(framed, None, (0, 0), (0,), flags=8)
    return np.asarray(framed[1:-1, 1:-1])
