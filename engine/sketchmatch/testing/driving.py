"""A robot's way through a place, and where it believes to have been."""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sketchmatch.model import FloatArray, IntArray
from sketchmatch.testing.lidar import World

__all__ = ["Odometry", "estimate_poses", "plan_tour"]


@dataclass(frozen=True)
class Odometry:
    """How the robot errs about its own pose.

    Attributes
    ----------
    position
        Standard deviation of the error in x and in y gathered over one metre, in metres.
    heading
        Standard deviation of the error in heading gathered over one metre, in radians.
    correction
        Share of the whole error that scan matching removes over one metre, from 0 (pure
        odometry) to below 1.
    """

    position: float = 0.02
    heading: float = 0.008
    correction: float = 0.35


def plan_tour(
    world: World,
    rng: np.random.Generator,
    *,
    stops: int | FloatArray | Sequence[Any] = 12,
    clearance: float = 0.25,
    spacing: float = 0.1,
) -> FloatArray:
    """Return a round trip through the free space that passes many places.

    Parameters
    ----------
    world
        What is there.
    rng
        Chooses the start when ``stops`` is a number.
    stops
        The places (x, y) to pass, in order; or how many, each then as far from all others as can
        be, in the largest space that the walls enclose, the nearest next.
    clearance
        Metres that the robot keeps from everything.
    spacing
        Metres between poses.

    Returns
    -------
    ndarray
        Shape (k, 3): x, y in metres, and heading in radians. The last pose is near the first.

    Raises
    ------
    ValueError
        If there is no way between two stops.
    """
    field = _DrivingField.of(world, clearance)
    if isinstance(stops, int):
        nodes = field.spread_stops(rng, stops)
    else:
        nodes = [field.nearest(point) for point in stops]
    legs = [field.way(a, b) for a, b in zip(nodes, nodes[1:] + nodes[:1], strict=True)]
    path = field.points[np.concatenate(legs)]
    return _poses_along(path, spacing)


def estimate_poses(
    poses: FloatArray, rng: np.random.Generator, odometry: Odometry | None = None
) -> FloatArray:
    """Return where the robot believes it was.

    Each move is measured with an error and added to the last belief, so errors grow with the way
    and a wrong heading bends it; scan matching then removes a share of the whole error.

    Parameters
    ----------
    poses
        Shape (k, 3), the truth. The first is known.
    rng
        Source of the errors.
    odometry
        How large they are; usual values when left out.

    Returns
    -------
    ndarray
        Shape (k, 3).
    """
    odometry = odometry or Odometry()
    noise = rng.normal(size=(len(poses), 3))
    noise *= [odometry.position, odometry.position, odometry.heading]
    believed = np.array(poses, dtype=np.float64)
    for k in range(1, len(poses)):
        move = poses[k] - poses[k - 1]
        turn = math.remainder(move[2], 2.0 * math.pi)
        way = math.hypot(move[0], move[1])
        bent = _turned(move[:2], believed[k - 1, 2] - poses[k - 1, 2])
        guess = believed[k - 1] + [*bent, turn] + noise[k] * math.sqrt(way)
        error = guess - poses[k]
        error[2] = math.remainder(error[2], 2.0 * math.pi)
        believed[k] = poses[k] + error * (1.0 - odometry.correction) ** way
    return believed


@dataclass(frozen=True, eq=False)
class _DrivingField:
    """A lattice of points on which ways are planned; points are numbered row by row."""

    points: FloatArray
    free: NDArray[np.bool_]
    columns: int

    @classmethod
    def of(cls, world: World, clearance: float, step: float = 0.1) -> _DrivingField:
        corners = world.segments.reshape(-1, 2)
        low = corners.min(axis=0)
        columns, rows = (np.ceil((corners.max(axis=0) - low) / step).astype(int) + 1).tolist()
        y, x = np.mgrid[0:rows, 0:columns]
        points = low + step * np.stack([x.ravel(), y.ravel()], axis=1)
        free = _clear_of(world.segments, points, clearance)
        border = (x == 0) | (y == 0) | (x == columns - 1) | (y == rows - 1)
        return cls(points, free & ~border.ravel(), columns)

    def nearest(self, point: Any) -> int:
        apart = np.hypot(*(self.points - np.asarray(point, dtype=np.float64)).T)
        return int(np.argmin(np.where(self.free, apart, np.inf)))

    def spread_stops(self, rng: np.random.Generator, count: int) -> list[int]:
        """Return stops far from each other, in an order that goes to the nearest next."""
        mask = self.free.reshape(-1, self.columns).astype(np.uint8)
        _, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=4)
        room = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
        inside = np.flatnonzero(labels.ravel() == room)
        chosen = [int(rng.choice(inside))]
        lengths = [self.ways_from(chosen[0])[0]]
        while len(chosen) < count:
            far = np.min(lengths, axis=0)[inside]
            chosen.append(int(inside[np.argmax(far)]))
            lengths.append(self.ways_from(chosen[-1])[0])
        between = np.array(lengths)[:, chosen]
        return [chosen[k] for k in _nearest_next(between)]

    def way(self, start: int, end: int) -> IntArray:
        """Return the points of the shortest way, from start to before the end."""
        length, previous = self.ways_from(start)
        if not math.isfinite(length[end]):
            x, y = self.points[end]
            raise ValueError(f"there is no way to the stop near ({x:.2f}, {y:.2f})")
        way = []
        while end != start:
            end = int(previous[end])
            way.append(end)
        return np.array(way[::-1], dtype=np.int64)

    def ways_from(self, start: int) -> tuple[FloatArray, IntArray]:
        """Return the length of the shortest way to each point, and the point before (Dijkstra)."""
        length = np.full(len(self.points), np.inf)
        previous = np.full(len(self.points), -1, dtype=np.int64)
        length[start] = 0.0
        queue = [(0.0, start)]
        moves = [(dx + self.columns * dy, math.hypot(dx, dy)) for dx, dy in _NEIGHBOURS]
        while queue:
            so_far, node = heapq.heappop(queue)
            if so_far > length[node]:
                continue
            for offset, cost in moves:
                to = node + offset
                if self.free[to] and so_far + cost < length[to]:
                    length[to] = so_far + cost
                    previous[to] = node
                    heapq.heappush(queue, (so_far + cost, to))
        return length, previous


_NEIGHBOURS = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)]


def _clear_of(segments: FloatArray, points: FloatArray, clearance: float) -> NDArray[np.bool_]:
    """Whether each point keeps ``clearance`` from all segments."""
    clear = np.ones(len(points), dtype=bool)
    for start, end in segments:
        along = end - start
        share = (points - start) @ along / max(float(along @ along), 1e-12)
        foot = start + np.clip(share, 0.0, 1.0)[:, None] * along
        clear &= np.hypot(*(points - foot).T) >= clearance
    return clear


def _nearest_next(between: FloatArray) -> list[int]:
    order, left = [0], set(range(1, len(between)))
    while left:
        order.append(min(left, key=lambda k: (between[order[-1], k], k)))
        left.remove(order[-1])
    return order


def _poses_along(path: FloatArray, spacing: float) -> FloatArray:
    """Return evenly spaced poses on a smoothed closed path."""
    window = 5
    ring = np.vstack([path[-window:], path, path[:window]])
    kernel = np.full(window, 1.0 / window)
    smooth = np.stack([np.convolve(axis, kernel, mode="same") for axis in ring.T], axis=1)
    smooth = smooth[window:-window]
    travelled = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(smooth, axis=0).T))])
    at = np.arange(0.0, travelled[-1], spacing)
    x, y = (np.interp(at, travelled, axis) for axis in smooth.T)
    heading = np.arctan2(np.gradient(y), np.gradient(x))
    return np.stack([x, y, heading], axis=1)


def _turned(vector: FloatArray, angle: float) -> FloatArray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])
