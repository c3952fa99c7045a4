"""Occupancy grid mapping: scans from known poses to a grid of log-odds, and to a ROS map.

Each scan votes once on every cell that its beams touch: occupied where a beam ends, free where it
passes (Moravec & Elfes 1985; Thrun, Burgard & Fox, Probabilistic Robotics, 2005, chapter 9, with
the bounded log-odds of Hornung et al., OctoMap, 2013).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sketchmatch.model import FloatArray, IntArray, OccupancyGrid

__all__ = ["LogOddsGrid", "SensorModel", "map_scans"]


@dataclass(frozen=True)
class SensorModel:
    """What one scan says about a cell, and when a cell counts as known.

    Attributes
    ----------
    hit, miss
        Log-odds that a cell gains when a beam ends in it, or passes through it.
    limit
        Largest magnitude of a cell's log-odds, which keeps the map able to change.
    occupied_above, free_below
        Probabilities beyond which a cell is occupied or free; between them it is unknown.
    """

    hit: float = 0.85
    miss: float = -0.4
    limit: float = 3.5
    occupied_above: float = 0.65
    free_below: float = 0.196


@dataclass(frozen=True, eq=False)
class LogOddsGrid:
    """What mapping has gathered about each cell.

    Attributes
    ----------
    values
        Shape (rows, columns), row 0 the lowest: log-odds that a cell is occupied, 0 where no
        beam came.
    resolution
        Metres a cell.
    origin
        x, y of the lower left corner of cell (0, 0), in metres.
    """

    values: FloatArray
    resolution: float
    origin: tuple[float, float]

    @property
    def probability(self) -> FloatArray:
        """Probability that each cell is occupied, shape (rows, columns)."""
        return 1.0 / (1.0 + np.exp(-self.values))

    def occupancy_grid(self, model: SensorModel | None = None) -> OccupancyGrid:
        """Return the grid with cells −1 (unknown), 0 (free) or 100 (occupied)."""
        model = model or SensorModel()
        cells = np.full(self.values.shape, -1, dtype=np.int8)
        cells[self.values > _log_odds(model.occupied_above)] = 100
        cells[self.values < _log_odds(model.free_below)] = 0
        return OccupancyGrid(cells, self.resolution, (*self.origin, 0.0))

    def cropped(self, margin: float) -> LogOddsGrid:
        """Return the part that beams have touched, with ``margin`` metres of unknown around it."""
        rows, columns = (np.flatnonzero(self.values.any(axis=axis)) for axis in (1, 0))
        if not rows.size:
            return self
        pad = math.ceil(margin / self.resolution)
        inner = self.values[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        x = self.origin[0] + (int(columns[0]) - pad) * self.resolution
        y = self.origin[1] + (int(rows[0]) - pad) * self.resolution
        return LogOddsGrid(np.pad(inner, pad), self.resolution, (x, y))


def map_scans(
    poses: FloatArray,
    ranges: FloatArray,
    bearings: FloatArray,
    *,
    max_range: float,
    resolution: float = 0.05,
    model: SensorModel | None = None,
    margin: float = 0.5,
) -> LogOddsGrid:
    """Build a map of scans.

    Parameters
    ----------
    poses
        Shape (k, 3): where the robot believes it was, x and y in metres and heading in radians.
        Walls come out as sharp as these are true.
    ranges
        Shape (k, beams), in metres: ``inf`` where nothing came back within ``max_range`` (the
        beam clears all its way), NaN where the reading was lost (the beam says nothing).
    bearings
        Shape (beams,), radians from the heading, counter-clockwise.
    max_range
        Metres that a beam without an echo clears.
    resolution
        Metres a cell.
    model
        How scans change cells; the usual values when left out.
    margin
        Metres of unknown around what was seen.

    Returns
    -------
    LogOddsGrid
        Its corner lies on a multiple of the resolution.

    Examples
    --------
    >>> import numpy as np
    >>> one_beam = map_scans(np.zeros((1, 3)), np.array([[0.2]]), np.zeros(1), max_range=1.0,
    ...                      margin=0.0)
    >>> one_beam.values.tolist(), one_beam.origin
    ([[-0.4, -0.4, -0.4, -0.4, 0.85]], (0.0, 0.0))
    """
    model = model or SensorModel()
    corner = np.floor((poses[:, :2].min(axis=0) - max_range) / resolution).astype(np.int64) - 1
    top = np.ceil((poses[:, :2].max(axis=0) + max_range) / resolution).astype(np.int64) + 1
    columns, rows = top - corner
    values = np.zeros((rows, columns))
    for pose, scan in zip(poses, ranges, strict=True):
        heard = ~np.isnan(scan)
        echo = np.isfinite(scan[heard])
        reach = np.where(echo, scan[heard], max_range)
        angles = pose[2] + bearings[heard]
        tips = pose[:2] + reach[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        start = np.floor(pose[:2] / resolution).astype(np.int64) - corner
        ends = np.floor(tips / resolution).astype(np.int64) - corner
        _vote(values, start, ends, echo, model)
    origin = (float(corner[0]) * resolution, float(corner[1]) * resolution)
    return LogOddsGrid(values, resolution, origin).cropped(margin)


def _vote(
    values: FloatArray,
    start: IntArray,
    ends: IntArray,
    echo: np.ndarray[tuple[int], np.dtype[np.bool_]],
    model: SensorModel,
) -> None:
    """Let one scan vote, once for each cell; a cell in which any beam ends is not passed."""
    passed = np.zeros(values.shape, dtype=bool)
    passed[_cells_before(start, ends)] = True
    hit = (ends[echo, 1], ends[echo, 0])
    passed[hit] = False
    values[passed] = np.maximum(values[passed] + model.miss, -model.limit)
    values[hit] = np.minimum(values[hit] + model.hit, model.limit)


def _cells_before(start: IntArray, ends: IntArray) -> tuple[IntArray, IntArray]:
    """Return (rows, columns) of all cells on the lines from start to ends, without their ends.

    Bresenham's lines in whole numbers, so that every machine draws the same ones.
    """
    delta = ends - start
    length = np.maximum(np.abs(delta).max(axis=1), 1)
    steps = np.arange(int(length.max(initial=1)))
    on_line = steps[None, :] < length[:, None]
    doubled = 2 * steps[None, :, None] * delta[:, None, :] + length[:, None, None]
    cells = start + doubled // (2 * length[:, None, None])
    columns, rows = cells[on_line].T
    return rows, columns


def _log_odds(probability: float) -> float:
    return math.log(probability / (1.0 - probability))
