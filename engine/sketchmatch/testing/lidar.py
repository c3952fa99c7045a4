"""A simulated 2-D lidar in a world of walls and solid furniture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from sketchmatch.model import FloatArray, SceneObject
from sketchmatch.model.caching import cached_property

__all__ = ["Lidar", "World", "cast_rays", "scan"]


@dataclass(frozen=True, eq=False)
class World:
    """A place as the lidar's plane cuts it.

    Attributes
    ----------
    walls
        Polylines, each of shape (k, 2), in metres; close one by repeating its first point.
    furniture
        Solid objects that stand in it.
    """

    walls: tuple[FloatArray, ...]
    furniture: tuple[SceneObject, ...] = ()

    @cached_property
    def segments(self) -> FloatArray:
        """All that a beam can hit, shape (m, 2, 2): start and end points."""
        rings = [ring for item in self.furniture for ring in item.rings]
        lines = [*self.walls, *(np.vstack([ring, ring[:1]]) for ring in rings)]
        ends: FloatArray = np.concatenate(
            [np.stack([line[:-1], line[1:]], axis=1) for line in lines], dtype=np.float64
        )
        return ends


@dataclass(frozen=True)
class Lidar:
    """A 2-D laser scanner that looks all around.

    Attributes
    ----------
    beams
        Beams a turn, evenly spaced.
    max_range
        Metres within which it hears an echo.
    noise
        Standard deviation of a range, in metres.
    dropout
        Share of the readings that are lost.
    mixing
        Probability that a beam which grazes an edge reads a distance between what is before and
        what is behind it.
    step
        Metres to which ranges are rounded; 0 for not at all.
    """

    beams: int = 360
    max_range: float = 8.0
    noise: float = 0.01
    dropout: float = 0.01
    mixing: float = 0.2
    step: float = 0.001

    @property
    def bearings(self) -> FloatArray:
        """Directions of the beams in radians from the heading, shape (beams,)."""
        return np.linspace(0.0, 2.0 * np.pi, self.beams, endpoint=False)


def cast_rays(world: World, position: Any, angles: FloatArray) -> FloatArray:
    """Return the distance from a point to the first thing in each direction.

    Parameters
    ----------
    world
        What is there.
    position
        x, y in metres.
    angles
        Shape (b,), radians in the world's frame.

    Returns
    -------
    ndarray
        Shape (b,), metres; ``inf`` where there is nothing.

    Examples
    --------
    >>> import numpy as np
    >>> wall = World((np.array([[2.0, -1.0], [2.0, 1.0]]),))
    >>> cast_rays(wall, (0.0, 0.0), np.array([0.0, np.pi]))
    array([ 2., inf])
    """
    start = world.segments[:, 0] - np.asarray(position, dtype=np.float64)
    along = world.segments[:, 1] - world.segments[:, 0]
    ray_x, ray_y = np.cos(angles)[:, None], np.sin(angles)[:, None]
    across = ray_x * along[:, 1] - ray_y * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / across
        share = (start[:, 0] * ray_y - start[:, 1] * ray_x) / across
        seen = (distance > 0.0) & (share >= 0.0) & (share <= 1.0)
    nearest: FloatArray = np.where(seen, distance, np.inf).min(axis=1)
    return nearest


def scan(
    world: World, pose: FloatArray, rng: np.random.Generator, lidar: Lidar | None = None
) -> FloatArray:
    """Take one scan.

    Parameters
    ----------
    world
        What is there.
    pose
        Shape (3,): x, y in metres and heading in radians.
    rng
        Source of the noise.
    lidar
        The scanner; usual values when left out.

    Returns
    -------
    ndarray
        Shape (beams,), metres: ``inf`` where nothing is within reach, NaN where the reading was
        lost.
    """
    lidar = lidar or Lidar()
    ranges = cast_rays(world, pose[:2], pose[2] + lidar.bearings)
    ranges[ranges > lidar.max_range] = np.inf
    ranges = _mixed_at_edges(ranges, rng, lidar.mixing) + rng.normal(0.0, lidar.noise, lidar.beams)
    ranges = np.maximum(ranges, 0.0)
    if lidar.step > 0.0:
        ranges = np.rint(ranges / lidar.step) * lidar.step
    ranges[rng.random(lidar.beams) < lidar.dropout] = np.nan
    return ranges


def _mixed_at_edges(ranges: FloatArray, rng: np.random.Generator, mixing: float) -> FloatArray:
    """Return ranges in which some beams at depth edges read a distance in between."""
    behind = np.roll(ranges, -1)
    with np.errstate(invalid="ignore"):
        jump = np.abs(behind - ranges)
        # Along a wall seen aslant the jumps grow evenly; an edge stands out from its neighbours.
        edge = (jump > 0.2) & (jump > 2.0 * np.roll(jump, 1)) & (jump > 2.0 * np.roll(jump, -1))
    chosen = edge & np.isfinite(jump) & (rng.random(len(ranges)) < mixing)
    share = rng.random(len(ranges))
    mixed = ranges.copy()
    mixed[chosen] += share[chosen] * (behind[chosen] - ranges[chosen])
    return mixed
