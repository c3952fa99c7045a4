"""Masks of a grid's cells: what is free, what that encloses, and where it lies in the map."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import cast

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field

from sketchmatch.api import InvalidInputError, Params, Reason
from sketchmatch.model import FloatArray, OccupancyGrid
from sketchmatch_builtin.segmenters._border import outer_borders

__all__ = [
    "TOLERANCE",
    "FreeSpaceParams",
    "Mask",
    "closed",
    "free_cells",
    "holes",
    "in_map",
    "outlines",
    "reading_order",
    "refuse_more",
    "simplified",
]

Mask = NDArray[np.uint8]

# In cells: wider gaps are closed by distances, which is soon done, but an odd one as the next even.
_LARGEST_KERNEL = 20
# In cells: the disc of so narrow a gap is a square, which closes all that a line does.
_SQUARE = 2

# What has more corners is simplified ring by ring.
_CORNERS, _TRIANGLE = 50, 3

# In percent, where neither the map nor a parameter says what is free.
_FREE = 25

TOLERANCE = 0.75
"""In cells: the steps of a slanted border leave the straight line by up to √½ of a cell."""


class FreeSpaceParams(Params):
    """What is free."""

    free_threshold: int | None = Field(
        None,
        ge=1,
        le=100,
        description=(
            "Known cells with an occupancy below this are free; by default 25, or the thresholds "
            "in the file of a map of map_server, which this overrides."
        ),
        json_schema_extra={"unit": "%"},
    )
    keep_unknown: bool = Field(
        True,
        description=(
            "The grey 205, with which map_server saves unknown cells, stays unknown even if "
            "thresholds make it free; false applies the thresholds."
        ),
    )


def free_cells(grid: OccupancyGrid, params: FreeSpaceParams) -> tuple[Mask, tuple[int, int]]:
    """Return a mask of the free cells, cropped to them, and the (x, y) of its first cell.

    Raises
    ------
    InvalidInputError
        With the path ``cells``, if none is free.
    """
    picture, threshold, keep_unknown = grid.picture, params.free_threshold, params.keep_unknown
    if picture is None or (threshold is None and keep_unknown):
        # Seen as unsigned, unknown is 255: one comparison is enough.
        free = grid.cells.view(np.uint8) < (_FREE if threshold is None else threshold)
    else:
        free = picture.free(None if threshold is None else threshold / 100.0)
        if keep_unknown:
            free &= (picture.shades != picture.saved_unknown) | (grid.cells >= 0)
    mask = free.view(np.uint8)
    x, y, columns, rows = cv2.boundingRect(mask)
    if not rows:
        raise InvalidInputError(
            Reason.TOO_FEW_OBJECTS,
            "cells",
            "has no free cell; objects are looked for inside free space, so check the "
            "thresholds of the map and free_threshold",
        )
    return mask[y : y + rows, x : x + columns], (x, y)


def holes(region: Mask) -> Mask:
    """Return the cells that a region encloses."""
    # A frame of cells around the grid joins all that lies outside.
    rest = cv2.copyMakeBorder(1 - region, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=(1,))
    cv2.floodFill(rest, None, (0, 0), (0,), flags=8)
    return np.asarray(rest[1:-1, 1:-1])


def closed(mask: Mask, gap: int) -> Mask:
    """Return a mask with gaps of so many cells closed, and what is then enclosed filled.

    A gap is as wide as the disc that passes it, however it runs, and also between two corners.
    """
    x, y, columns, rows = cv2.boundingRect(mask)
    if not rows:
        return mask
    framed = np.pad(mask[y : y + rows, x : x + columns], gap)
    shrunk = _closed_by_discs(framed, gap)
    if gap > _SQUARE:
        # Between small things a disc would pass in part.
        for side in ((1, gap + 1), (gap + 1, 1)):
            shrunk |= _closed_by(framed, np.ones(side, np.uint8))
    contours, _ = cv2.findContours(shrunk, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    filled = np.zeros(shrunk.shape, np.uint8)
    cv2.drawContours(filled, contours, -1, (1,), cv2.FILLED)
    result = np.zeros_like(mask)
    result[y : y + rows, x : x + columns] = filled[gap : gap + rows, gap : gap + columns]
    return result


def _closed_by_discs(mask: Mask, gap: int) -> Mask:
    """Return a mask with what discs cannot enter, or reach from outside."""
    radius = (gap + 1) / 2.0
    if gap <= _LARGEST_KERNEL:
        at = np.arange(gap + 1) - gap / 2.0
        disc = (np.hypot(at, at[:, None]) <= radius).astype(np.uint8)
        return _closed_by(mask, disc, enclosed=True)
    grown = _within(mask, radius)
    return 1 - _within(1 - (grown | holes(grown)), radius)


def _closed_by(mask: Mask, kernel: Mask, *, enclosed: bool = False) -> Mask:
    """Return a mask grown by a kernel and shrunk again, and in between what it encloses filled."""
    last = np.array(kernel.shape[::-1]) - 1
    there = last // 2
    grown = np.asarray(cv2.dilate(mask, kernel, anchor=there.tolist()), dtype=np.uint8)
    if enclosed:
        grown |= holes(grown)
    # The middle of an even number of cells is one of two, on the way back the other.
    shrunk = cv2.erode(grown, kernel, anchor=(last - there).tolist())
    return np.asarray(shrunk, dtype=np.uint8)


def _within(mask: Mask, radius: float) -> Mask:
    """Return the cells that are at most so far from a mask."""
    away = cv2.distanceTransform(1 - mask, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return (away <= radius).view(np.uint8)


def refuse_more(count: int, most: int, remedy: str) -> None:
    """Refuse more than ``most`` objects.

    Raises
    ------
    InvalidInputError
        With the path ``cells`` and the remedy.
    """
    if count > most:
        raise InvalidInputError(
            Reason.LIMIT_EXCEEDED,
            "cells",
            f"has {count} objects, more than the limit of {most}; {remedy}",
        )


def outlines(mask: Mask) -> Iterator[tuple[tuple[int, int], FloatArray]]:
    """Yield (row, column) of a cell of each component of a mask, and its outline.

    The cell is the leftmost one of the component's first row. All are found at once: each by
    itself, of corridors around each other every one would cost the whole grid.
    """
    for border in outer_borders(mask):
        x, y = border[0].astype(int).tolist()
        yield (y, x), border


def simplified(polygon: shapely.Polygon, tolerance: float) -> shapely.Polygon:
    """Return a polygon with fewer corners, of which none was farther away than the tolerance.

    Of many corners GEOS looks at each line again, whether it crosses another; that costs more than
    to look whether any does in the end, which happens hardly ever.
    """
    if shapely.get_num_coordinates(polygon) > _CORNERS:
        rings = (polygon.exterior, *polygon.interiors)
        outer, *inner = (_simplified(ring, tolerance) for ring in rings)
        if all(len(ring) >= _TRIANGLE for ring in (outer, *inner)):
            plain = shapely.Polygon(outer, inner)
            if plain.is_valid:
                return plain
    return cast(shapely.Polygon, polygon.simplify(tolerance))


def _simplified(ring: shapely.LinearRing, tolerance: float) -> FloatArray:
    """Return the corners of a simplified ring, begun where GEOS begins that of a polygon."""
    corners = shapely.get_coordinates(ring.simplify(tolerance, preserve_topology=False))[:-1]
    begun = (corners[0] == shapely.get_coordinates(ring)[0]).all()
    return corners if begun else np.roll(corners, 1, axis=0)


def in_map(points: FloatArray, grid: OccupancyGrid) -> FloatArray:
    """Return points given in cells in the map's frame, in metres."""
    x, y, yaw = grid.origin
    c, s = math.cos(yaw), math.sin(yaw)
    turning = np.array([[c, s], [-s, c]])
    return np.asarray(grid.resolution * points @ turning + (x, y), dtype=np.float64)


def reading_order(polygon: shapely.Polygon) -> tuple[float, float]:
    """Return what sorts objects from the top down, then from the left."""
    left, _, _, top = polygon.bounds
    return (-top, left)
