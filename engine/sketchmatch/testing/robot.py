"""A simulated mobile robot: it drives through a furnished place, scans, and maps what it sees.

The lidar measures a world of walls and solid furniture; odometry errs and scan matching corrects
it in part, so that the map has what real ones have: walls a little double and askew, grey unknown
inside of things and behind them, ragged edges and specks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sketchmatch.model import FloatArray, OccupancyGrid
from sketchmatch.testing.driving import Odometry, estimate_poses, plan_tour
from sketchmatch.testing.lidar import Lidar, World, scan
from sketchmatch.testing.mapping import LogOddsGrid, SensorModel, map_scans

__all__ = ["Survey", "survey"]


@dataclass(frozen=True, eq=False)
class Survey:
    """The result of a drive.

    Attributes
    ----------
    poses, estimates
        Shape (k, 3): true and believed x, y in metres and heading in radians of each scan.
    log_odds
        What mapping gathered.
    grid
        The map that a robot would save.
    """

    poses: FloatArray
    estimates: FloatArray
    log_odds: LogOddsGrid
    grid: OccupancyGrid


def survey(
    world: World,
    rng: np.random.Generator,
    *,
    poses: FloatArray | None = None,
    lidar: Lidar | None = None,
    odometry: Odometry | None = None,
    model: SensorModel | None = None,
    resolution: float = 0.05,
    margin: float = 0.5,
) -> Survey:
    """Drive through a world and map it.

    Parameters
    ----------
    world
        What is there.
    rng
        Source of all randomness.
    poses
        Shape (k, 3): where the scans are taken, see :func:`plan_tour`; a tour of the largest room
        when left out.
    lidar, odometry, model
        The robot; usual values when left out.
    resolution
        Metres a cell.
    margin
        Metres of unknown around what was seen.

    Returns
    -------
    Survey
        Its map is in the world's frame, as far as the robot knew where it was.
    """
    lidar, odometry, model = lidar or Lidar(), odometry or Odometry(), model or SensorModel()
    poses = plan_tour(world, rng) if poses is None else np.asarray(poses, dtype=np.float64)
    estimates = estimate_poses(poses, rng, odometry)
    ranges = np.stack([scan(world, pose, rng, lidar) for pose in poses])
    log_odds = map_scans(
        estimates,
        ranges,
        lidar.bearings,
        max_range=lidar.max_range,
        resolution=resolution,
        model=model,
        margin=margin,
    )
    return Survey(poses, estimates, log_odds, log_odds.occupancy_grid(model))
