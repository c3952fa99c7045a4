"""Where a robot of some radius may be on a grid, and ways between two places there."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray

from sketchmatch.kernels.clearing import legs_clear
from sketchmatch.kernels.raster import crossed_pixels, filled_pixels
from sketchmatch.model import BoolArray, FloatArray, IntArray, OccupancyGrid, Scene
from sketchmatch.model.arrays import Float32Array
from sketchmatch.model.caching import cached_property

__all__ = ["Obstacles", "Window", "reached", "sampled"]

_OCCUPIED = 65
"""Percent, from which a cell is an obstacle: the usual threshold of map_server."""
_CORNER = math.sqrt(0.5)
_NO_NEARER = 0.5
"""In cells: how far from obstacles a way stays that need not keep away, lest it cut a corner."""
_ROUNDING = 1e-9
_ROUNDED = 1.0 - 1e-6
"""Of distances in single precision, which must not be too large."""
_MOST_CELLS = 4_000_000
_PER_SPACING = 24.0
_FARTHEST_CELLS = 128
_UNSURE = 0.25
"""In cells: what middles may have more room than is said."""
_BESIDE = 4
_FINER = 3
"""An odd number: the middle of a cell is one of a finer cell, too."""

PixelsArray = NDArray[np.uint8]
_T = TypeVar("_T", bound=np.generic)


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Cells that are free or not.

    Attributes
    ----------
    blocked
        Shape (rows, columns), row 0 the lowest.
    resolution
        Side of a cell.
    origin
        Pose (x, y, yaw) of the lower left corner of cell (0, 0).
    """

    blocked: BoolArray
    resolution: float
    origin: tuple[float, float, float]

    @classmethod
    def of_grid(cls, grid: OccupancyGrid, allow_unknown: bool) -> Obstacles:
        """Return what is occupied on a grid, and what is unknown unless that is allowed."""
        occupied = grid.cells >= _OCCUPIED
        blocked = occupied if allow_unknown else occupied | (grid.cells < 0)
        return cls(blocked, grid.resolution, grid.origin)

    @classmethod
    def of_scene(cls, scene: Scene, around: FloatArray, radius: float) -> Obstacles:
        """Return the objects of a scene as cells, with room for a way around points."""
        x0, y0, x1, y1 = scene.bounds
        points = np.vstack([around.reshape(-1, 2), [(x0, y0), (x1, y1)]])
        small = math.sqrt(min(item.area for item in scene.objects))
        extent = np.ptp(points, axis=0)
        margin = 4.0 * radius + small
        low, sides = points.min(axis=0) - margin, extent + 2.0 * margin
        step = max(min(small, 4.0 * radius) / _PER_SPACING, float(extent.max()) / 2000.0)
        step = max(step, math.sqrt(float(sides[0] * sides[1]) / _MOST_CELLS))
        columns, rows = (math.ceil(side / step) for side in sides)
        outlines = [[(ring - low)[:, ::-1] / step for ring in item.rings] for item in scene.objects]
        blocked = reached(outlines, (rows, columns))
        return cls(blocked, step, (float(low[0]), float(low[1]), 0.0))

    @cached_property
    def room(self) -> Float32Array:
        """How far each cell is from the nearest obstacle's, square from square, in cells."""
        wide = cv2.dilate(self._walled, np.ones((3, 3), dtype=np.uint8))
        return _distances(wide.astype(np.uint8, copy=False))

    @cached_property
    def clearance(self) -> Float32Array:
        """How far the middle of each cell is from obstacles, at least."""
        found: Float32Array = np.maximum(
            _distances(self._walled) - np.float32(_CORNER), self.room + np.float32(0.5)
        )
        found[self.blocked] = 0.0
        found *= np.float32(self.resolution)
        return found

    @property
    def _walled(self) -> PixelsArray:
        """What is blocked, with a border of such cells around it."""
        return np.pad(self.blocked.astype(np.uint8), 1, constant_values=1)

    def local(self, points: FloatArray) -> FloatArray:
        """Return points as row and column in units of cells, shape (m, 2)."""
        x, y, yaw = self.origin
        c, s = math.cos(yaw), math.sin(yaw)
        found: FloatArray = (points - (x, y)) @ np.array([[-s, c], [c, s]]) / self.resolution
        return found

    def placed(self, local: FloatArray) -> FloatArray:
        """Return the points at rows and columns, shape (m, 2): what :meth:`local` undoes."""
        x, y, yaw = self.origin
        c, s = math.cos(yaw), math.sin(yaw)
        found: FloatArray = (local * self.resolution) @ np.array([[-s, c], [c, s]]) + (x, y)
        return found

    def cells(self, points: FloatArray) -> IntArray:
        """Return row and column of the cells of points, shape (m, 2), perhaps beyond the grid."""
        found: IntArray = np.floor(self.local(points)).astype(np.int64)
        return found

    def places(self, cells: IntArray) -> FloatArray:
        """Return the middles of cells, shape (m, 2)."""
        return self.placed(cells.astype(np.float64) + 0.5)

    def inside(self, points: FloatArray) -> BoolArray:
        """Return which points lie on the grid."""
        cells = self.cells(points)
        return np.asarray(((cells >= 0) & (cells < self.blocked.shape)).all(axis=1))

    def meets(self, rings: Sequence[FloatArray]) -> bool:
        """Whether an area, its outline and its holes, lies on the grid, or a part of it does."""
        outline, *holes = map(self.local, rings)
        grid = shapely.box(0.0, 0.0, *self.blocked.shape)
        return bool(shapely.Polygon(outline, holes).intersects(grid))

    def kept(self, radius: float) -> float:
        """Return how far from obstacles a robot of a radius is kept."""
        return max(radius, _NO_NEARER * self.resolution)

    def needed(self, radius: float) -> float:
        """Return how much room it needs in the middles of cells, to go straight between two next.

        Where both are so far from a point, all between them is as far as is to be kept.
        """
        return math.hypot(self.kept(radius), _CORNER * self.resolution) * _ROUNDED

    def clear(self, points: FloatArray, radius: float) -> BoolArray:
        """Return at which points a robot of a radius may be; nowhere beyond the grid."""
        return self.legs_clear(np.repeat(points, 2, axis=0), radius)[::2]

    def legs_clear(self, points: FloatArray, radius: float) -> BoolArray:
        """Return on which legs between points, of k − 1, a robot of a radius may be all along."""
        kept = self.kept(radius) / self.resolution - _ROUNDING
        return np.asarray(legs_clear(self.local(points), self.blocked, self.room, kept))

    def line_is_clear(self, points: FloatArray, radius: float) -> bool:
        """Whether a line through points stays clear all along."""
        return bool(self.legs_clear(points, radius).all())

    def finer(self, window: Window) -> Obstacles:
        """Return a part of them on cells of a third of the side; beyond it all is blocked."""
        (corner,) = self.placed(window.low[None, :].astype(np.float64))
        blocked = window.of(self.blocked).repeat(_FINER, axis=0).repeat(_FINER, axis=1)
        pose = (float(corner[0]), float(corner[1]), self.origin[2])
        return Obstacles(blocked, self.resolution / _FINER, pose)

    def beside(
        self, point: FloatArray, radius: float, open_: BoolArray, low: IntArray
    ) -> IntArray | None:
        """Return the nearest open cell to which a robot may go straight from a point, or None.

        Parameters
        ----------
        point, radius
            Where it is, and how large.
        open_, low
            Shape (rows, columns): which cells are open, from row and column ``low`` on.
        """
        (cell,) = self.cells(point[None, :]) - low
        first = np.clip(cell - _BESIDE, 0, open_.shape)
        last = np.clip(cell + _BESIDE + 1, 0, open_.shape)
        cells = np.argwhere(open_[first[0] : last[0], first[1] : last[1]]) + first
        if not len(cells):
            return None
        places = self.places(cells + low)
        legs = np.stack([np.broadcast_to(point, places.shape), places], axis=1).reshape(-1, 2)
        away = np.hypot(*(places - point).T)
        away[~self.legs_clear(legs, radius)[::2]] = np.inf
        best = int(np.argmin(away))
        return cells[best] if np.isfinite(away[best]) else None

    def nearest_clear(self, point: FloatArray, radius: float, within: float) -> FloatArray | None:
        """Return the nearest place to a point where a robot may be; None if none is near.

        It is looked for no farther than 128 cells away.
        """
        cell = self.cells(point[None, :])
        farthest = min(math.ceil(within / self.resolution), _FARTHEST_CELLS)
        reach = 0
        while reach < farthest:
            reach = min(4 * reach + 8, farthest)
            window = Window.around(self, cell, reach)
            likely = window.of(self.clearance) >= self.kept(radius) - _UNSURE * self.resolution
            places = self.places(np.argwhere(likely) + window.low)
            places = places[self.clear(places, radius)]
            if not len(places):
                continue
            away = np.hypot(*(places - point).T)
            best = int(np.argmin(away))
            # What is nearer than the window's sides is the nearest of all.
            if away[best] <= min(within, reach * self.resolution):
                found: FloatArray = places[best]
                return found
        return None


def reached(outlines: Iterable[Sequence[FloatArray]], shape: tuple[int, ...]) -> BoolArray:
    """Return which cells of a grid areas reach into.

    Parameters
    ----------
    outlines
        Of each area the outline and its holes, each of shape (k, 2), row and column in units of
        cells, perhaps beyond the grid.
    shape
        Rows and columns of the grid.

    Returns
    -------
    ndarray
        Of the shape: every cell of which some area covers a part, however small. A cell that an
        area touches at a side or a corner alone, up to a millionth of its side, is none.

    Examples
    --------
    >>> reached([[np.array([[0.0, 0.5], [0.0, 2.0], [1.1, 2.0]])]], (2, 3)).astype(int)
    array([[1, 1, 0],
           [0, 1, 0]])
    """
    found = np.zeros(shape, dtype=bool)
    for rings in outlines:
        starts = np.vstack(rings)
        ends = np.vstack([np.roll(ring, -1, axis=0) for ring in rings])
        low = np.clip(np.floor(starts.min(axis=0)), 0, shape).astype(np.int64)
        high = np.clip(np.ceil(starts.max(axis=0)), low, shape).astype(np.int64)
        rows, columns = (high - low).tolist()
        starts, ends = (np.ascontiguousarray((ring - low)[:, ::-1]) for ring in (starts, ends))
        part = found[low[0] : high[0], low[1] : high[1]]
        part |= filled_pixels(starts, ends, rows, columns)
        part |= crossed_pixels(starts, ends, rows, columns)
    return found


def _distances(walled: PixelsArray) -> Float32Array:
    """Return how far the cells within the border are from the nearest that is blocked."""
    away = cv2.distanceTransform(1 - walled, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(away[1:-1, 1:-1] * np.float32(_ROUNDED), dtype=np.float32)


def sampled(points: FloatArray, step: float) -> FloatArray:
    """Return points along a line, no farther apart than a step; its own points are among them."""
    lengths = np.hypot(*np.diff(points, axis=0).T)
    counts = np.maximum(1, np.ceil(lengths / step)).astype(np.int64)
    legs = np.repeat(np.arange(len(counts)), counts)
    firsts = np.repeat(np.cumsum(counts) - counts, counts)
    shares = (np.arange(len(legs)) - firsts) / counts[legs]
    between = points[legs] + shares[:, None] * (points[legs + 1] - points[legs])
    return np.vstack([between, points[-1:]])


@dataclass(frozen=True, eq=False)
class Window:
    """A part of a grid.

    Attributes
    ----------
    low, high
        Row and column of its first cell, and of the first one beyond it.
    """

    low: IntArray
    high: IntArray

    @classmethod
    def around(cls, obstacles: Obstacles, cells: IntArray, margin: int) -> Window:
        """Return the part around cells."""
        most = np.array(obstacles.blocked.shape)
        low = np.clip(cells.min(axis=0) - margin, 0, most)
        high = np.clip(cells.max(axis=0) + margin + 1, 0, most)
        return cls(low, high)

    def is_all_of(self, obstacles: Obstacles) -> bool:
        """Whether it is the whole grid."""
        return not self.low.any() and tuple(self.high) == obstacles.blocked.shape

    def of(self, array: NDArray[_T]) -> NDArray[_T]:
        """Return that part of an array of the whole grid."""
        return array[self.low[0] : self.high[0], self.low[1] : self.high[1]]
