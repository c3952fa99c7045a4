"""Objects of a robot's occupancy grid: what stands free in the room the robot saw."""

from __future__ import annotations

import math
from collections.abc import Iterator

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field

from sketchmatch.api import InvalidInputError, Params, Reason, Segmentation, Segmenter
from sketchmatch.model import FloatArray, OccupancyGrid, Scene, SceneObject
from sketchmatch_builtin.segmenters._border import outer_border

__all__ = ["OccupancyGridSegmenter"]

_Mask = NDArray[np.uint8]

# The steps of a slanted border leave the straight line by up to √½ of a cell.
_CELLS_TOLERANCE = 0.75
# As a share of an object's size: a tolerance beyond it would change the shape, not the noise.
_COARSEST_TOLERANCE = 0.12
_MOST_OBJECTS = 1000


class OccupancyGridSegmenter(Segmenter):
    """Takes as objects the holes in the largest free region.

    A region is free cells joined by their sides; a hole is what it encloses, joined by sides or
    corners. That fills an object's unseen interior, whatever its grey, and leaves out the walls
    and all that lies behind them. Outlines run exactly along the cells' borders and are
    then simplified [1]_.

    Objects come in reading order: by their highest point from the top down, then from the left.

    References
    ----------
    .. [1] D. H. Douglas, T. K. Peucker, "Algorithms for the reduction of the number of points
       required to represent a digitized line or its caricature", Cartographica 10(2), 1973.
    """

    name = "occupancy-grid"
    summary = "Objects standing in the largest free region of a robot's occupancy grid."
    sources = (OccupancyGrid,)

    class Params(Params):
        """What is free, what is too small to count, and how outlines are cleaned."""

        free_threshold: int = Field(
            25,
            ge=1,
            le=100,
            description="Known cells whose occupancy is below this are free, in percent.",
        )
        min_size: float = Field(
            0.2,
            ge=0.0,
            le=1000.0,
            description=(
                "Objects smaller than a square with this side are left out, in metres. The "
                "default keeps posts and drops table legs and speckle."
            ),
        )
        close_gaps: float = Field(
            0.1,
            ge=0.0,
            le=1.0,
            description=(
                "Gaps up to this wide are closed, in metres, in an object's outline and between "
                "objects, which then are one; 0 closes none."
            ),
        )
        tolerance: float | None = Field(
            None,
            ge=0.0,
            le=10.0,
            description=(
                "How far a simplified outline may leave the cells' borders, in metres, but never "
                "more than 12 % of the object's size; three quarters of a cell when left out."
            ),
        )

    params: Params

    def segment(self, source: OccupancyGrid) -> Segmentation:
        """Return the holes of the largest free region, in metres in the map's frame."""
        cells = source.cells
        region = _largest_region((cells >= 0) & (cells < self.params.free_threshold))
        holes = _closed(_holes(region), self._gap(source))
        least = (self.params.min_size / source.resolution) ** 2
        outlines = [
            self._outline(mask, corner, source) for mask, corner in _components(holes, least)
        ]
        if len(outlines) < 2:
            raise _too_few(len(outlines), int(region.sum()), source, self.params.min_size)
        outlines.sort(key=lambda outline: (-outline[:, 1].max(), outline[:, 0].min()))
        return Segmentation(
            Scene(tuple(SceneObject.from_rings([_in_map(o, source)]) for o in outlines))
        )

    def _gap(self, grid: OccupancyGrid) -> int:
        """Return the widest gap to close, in cells."""
        return int(min(self.params.close_gaps / grid.resolution + 0.5, max(grid.cells.shape)))

    def _outline(self, mask: _Mask, corner: tuple[int, int], grid: OccupancyGrid) -> FloatArray:
        """Return an object's outline in cells from the grid's lower left corner, shape (k, 2)."""
        if self.params.tolerance is None:
            tolerance = _CELLS_TOLERANCE
        else:
            tolerance = self.params.tolerance / grid.resolution
        tolerance = min(tolerance, _COARSEST_TOLERANCE * math.sqrt(np.count_nonzero(mask)))
        border = shapely.Polygon(outer_border(mask)).simplify(tolerance)
        return shapely.get_coordinates(border) + corner


def _largest_region(free: NDArray[np.bool_]) -> _Mask:
    """Return the largest region of free cells that are joined by their sides."""
    count, regions, statistics, _ = cv2.connectedComponentsWithStats(
        free.astype(np.uint8), connectivity=4
    )
    if count < 2:
        raise InvalidInputError(
            Reason.TOO_FEW_OBJECTS,
            "cells",
            "has no free cell; objects are looked for inside free space, so check the "
            "thresholds of the map and free_threshold",
        )
    largest = 1 + int(np.argmax(statistics[1:, cv2.CC_STAT_AREA]))
    return np.asarray(regions == largest, dtype=np.uint8)


def _holes(region: _Mask) -> _Mask:
    """Return the cells that the region encloses."""
    # A frame of cells around the grid joins all that lies outside.
    rest = np.pad(1 - region, 1, constant_values=1)
    cv2.floodFill(rest, None, (0, 0), 0, flags=8)
    return rest[1:-1, 1:-1]


def _closed(holes: _Mask, gap: int) -> _Mask:
    """Return the holes with gaps of so many cells closed, and what is then enclosed filled."""
    kernel = np.ones((gap + 1, gap + 1), np.uint8)
    there, back = (gap // 2, gap // 2), (gap - gap // 2, gap - gap // 2)
    grown = cv2.dilate(np.pad(holes, gap), kernel, anchor=there)
    closed = cv2.erode(grown, kernel, anchor=back)
    contours, _ = cv2.findContours(closed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    filled = np.zeros(closed.shape, np.uint8)
    cv2.drawContours(filled, contours, -1, 1, cv2.FILLED)
    rows, columns = holes.shape
    return filled[gap : gap + rows, gap : gap + columns]


def _components(mask: _Mask, least: float) -> Iterator[tuple[_Mask, tuple[int, int]]]:
    """Yield each component of at least so many cells, cropped, and the (x, y) of its crop."""
    count, labels, statistics, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    large = [k for k in range(1, count) if statistics[k, cv2.CC_STAT_AREA] >= least]
    if len(large) > _MOST_OBJECTS:
        raise InvalidInputError(
            Reason.LIMIT_EXCEEDED,
            "cells",
            f"has {len(large)} objects, more than the limit of {_MOST_OBJECTS}; raise min_size",
        )
    for k in large:
        x, y, width, height, _ = statistics[k].tolist()
        yield np.asarray(labels[y : y + height, x : x + width] == k, dtype=np.uint8), (x, y)


def _in_map(outline: FloatArray, grid: OccupancyGrid) -> FloatArray:
    """Return points given in cells in the map's frame, in metres."""
    x, y, yaw = grid.origin
    c, s = math.cos(yaw), math.sin(yaw)
    turning = np.array([[c, s], [-s, c]])
    return np.asarray(grid.resolution * outline @ turning + (x, y), dtype=np.float64)


def _too_few(found: int, free: int, grid: OccupancyGrid, min_size: float) -> InvalidInputError:
    return InvalidInputError(
        Reason.TOO_FEW_OBJECTS,
        "cells",
        f"has {'no object' if not found else 'only one object'} of at least {min_size:g} m within "
        f"its largest free region ({free * grid.resolution**2:.3g} m²), and a match needs two; "
        "give a map with objects standing free of the walls, or lower min_size",
    )
