"""Scenes A and B: rooms with free-standing furniture, as maps to scale and as occupancy grids.

Beside them there are scenes of any number of objects by chance, to measure times on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from sketchmatch.model import FloatArray, IntArray, OccupancyGrid, Scene, SceneObject
from sketchmatch.testing import World, plan_tour, random_scene, survey
from sketchmatch_builtin.segmenters.occupancy_grid import OccupancyGridSegmenter

__all__ = [
    "DRIVES",
    "PLACES",
    "Charted",
    "Place",
    "charted",
    "drive_through",
    "place_named",
    "truth_by_overlap",
]

DRIVES = 5
"""How many grids there are of each scene, each from a drive of its own."""

_GRID_SEED = 4300
_STOPS = 16
_LEAST_OVERLAP = 0.3


@dataclass(frozen=True, eq=False)
class Place:
    """A room and what stands in it.

    Attributes
    ----------
    name
        The scene's name in the thesis.
    room
        Corners of the walls, shape (k, 2), in metres.
    furniture
        The objects; object 1 of the tables is index 0.
    """

    name: str
    room: FloatArray
    furniture: Scene

    @property
    def world(self) -> World:
        """What the robot's lidar meets."""
        return World((np.vstack([self.room, self.room[:1]]),), self.furniture.objects)


@dataclass(frozen=True, eq=False)
class Charted:
    """A scene's objects as a map has them.

    Attributes
    ----------
    scene
        The objects of the map to scale, or those segmented from a grid.
    furniture
        Shape (N',): for each object the index of the piece of furniture it is, −1 for none.
    """

    scene: Scene
    furniture: IntArray


def place_named(name: str) -> Place:
    """Return scene A or B, or one of a number of objects such as "30", by chance."""
    return PLACES[name] if name in PLACES else _by_chance(name)


def charted(place: Place, drive: int | None = None) -> Charted:
    """Return a scene's map to scale, or the objects of the grid of one of the robot's drives."""
    if drive is None:
        return Charted(place.furniture, np.arange(len(place.furniture)))
    return _segmented_grid(place.name, drive)


def drive_through(place: Place, drive: int) -> OccupancyGrid:
    """Return the grid that a robot saves after one drive through the room."""
    rng = np.random.default_rng((_GRID_SEED, ord(place.name), drive))
    poses = plan_tour(place.world, rng, stops=_STOPS, spacing=0.2)
    return survey(place.world, rng, poses=poses).grid


def truth_by_overlap(objects: Scene, furniture: Scene) -> IntArray:
    """Return the piece of furniture that each object is: the one it shares most area with.

    Returns
    -------
    ndarray
        Shape (N',); −1 where the area shared is less than 0.3 of the area of both together.
    """
    found = np.full(len(objects), -1)
    for k, item in enumerate(objects.objects):
        shares = [_overlap(item, piece) for piece in furniture.objects]
        if max(shares) >= _LEAST_OVERLAP:
            found[k] = int(np.argmax(shares))
    return found


@cache
def _by_chance(name: str) -> Place:
    scene = random_scene(np.random.default_rng(int(name)), int(name))
    pieces = [(f"object {k + 1}", np.array(each.rings[0])) for k, each in enumerate(scene.objects)]
    x0, y0, x1, y1 = scene.bounds
    corners = [[x0 - 1, y0 - 1], [x1 + 1, y0 - 1], [x1 + 1, y1 + 1], [x0 - 1, y1 + 1]]
    return _place(name, corners, pieces)


@cache
def _segmented_grid(name: str, drive: int) -> Charted:
    place = PLACES[name]
    scene = OccupancyGridSegmenter().segment(drive_through(place, drive)).scene
    return Charted(scene, truth_by_overlap(scene, place.furniture))


def _overlap(one: SceneObject, other: SceneObject) -> float:
    shared = one.polygon.intersection(other.polygon).area
    return float(shared / (one.area + other.area - shared))


def _placed(outline: FloatArray, x: float, y: float, degrees: float = 0.0) -> FloatArray:
    """Return an outline, drawn around (0, 0), turned and moved into the room."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    placed: FloatArray = outline @ np.array([[c, s], [-s, c]]) + [x, y]
    return placed


def _box(width: float, depth: float) -> FloatArray:
    return np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * [width / 2, depth / 2]


def _round(width: float, depth: float) -> FloatArray:
    angles = np.arange(24) * (2.0 * np.pi / 24)
    return np.stack([np.cos(angles) * width / 2, np.sin(angles) * depth / 2], axis=1)


def _corner(width: float, depth: float, arm: float) -> FloatArray:
    """Return an L about the middle of its box."""
    ring = [[0, 0], [width, 0], [width, arm], [arm, arm], [arm, depth], [0, depth]]
    return np.array(ring) - [width / 2, depth / 2]


def _tee(width: float, depth: float, arm: float) -> FloatArray:
    """Return a T about the middle of its box, the stem down."""
    left, right, top = (width - arm) / 2, (width + arm) / 2, depth - arm
    ring = [
        [left, 0],
        [right, 0],
        [right, top],
        [width, top],
        [width, depth],
        [0, depth],
        [0, top],
        [left, top],
    ]
    return np.array(ring) - [width / 2, depth / 2]


def _place(name: str, room: list[list[float]], pieces: Sequence[tuple[str, FloatArray]]) -> Place:
    labels, outlines = [label for label, _ in pieces], [outline for _, outline in pieces]
    return Place(name, np.array(room), Scene.from_polygons(outlines, labels))


_A = _place(
    "A",
    [[0, 0], [9.2, 0], [9.2, 7.6], [0, 7.6]],
    [
        ("crate", _placed(_box(0.9, 0.6), 1.6, 6.3)),
        ("chest", _placed(_box(1.0, 0.75), 3.3, 6.1, 12)),
        ("desk", _placed(_corner(1.9, 1.3, 0.6), 7.1, 5.9, 180)),
        ("round table", _placed(_round(1.25, 1.25), 4.9, 4.2)),
        ("cabinet", _placed(_box(0.5, 1.5), 1.3, 3.7)),
        ("sofa", _placed(_box(2.1, 0.8), 3.2, 1.5, 6)),
        ("chair", _placed(_box(0.6, 0.55), 5.9, 1.7, 30)),
        ("barrel", _placed(_round(0.7, 0.6), 7.6, 2.2)),
    ],
)
_B = _place(
    "B",
    [[0, 0], [9.4, 0], [9.4, 4.6], [7.2, 4.6], [7.2, 6.6], [0, 6.6]],
    [
        ("bin", _placed(_round(0.65, 0.65), 1.3, 5.4)),
        ("crate", _placed(_box(1.0, 0.65), 2.9, 5.2, -8)),
        ("cabinet", _placed(_box(0.5, 1.5), 1.2, 3.1)),
        ("table", _placed(_box(1.8, 1.0), 5.0, 4.0, -18)),
        ("bench", _placed(_tee(1.5, 1.1, 0.45), 8.0, 2.9, 90)),
        ("chest", _placed(_box(0.8, 0.75), 2.6, 1.3, 20)),
        ("shelf", _placed(_box(1.8, 0.45), 5.9, 1.2)),
    ],
)

PLACES = {place.name: place for place in (_A, _B)}
