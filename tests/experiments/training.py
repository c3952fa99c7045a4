"""Sketches to learn from: of many kinds of maps, by people of many kinds.

How people draw is not known well enough to learn from one model of it, so each sketch has
deviations of its own, and each map things, sizes and an order of its own; some are of
:mod:`tests.experiments.people`, and others of :mod:`tests.experiments.halls`. Rooms, which lie side
by side, are those of :mod:`tests.experiments.floors`. The study measures with
:mod:`tests.experiments.generators`, which are others.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely

from sketchmatch.errors import InvalidInputError
from sketchmatch.model import FloatArray, IntArray, Scene, SceneObject
from sketchmatch.testing import random_scene
from tests.experiments.drawings import Drawing
from tests.experiments.halls import hall, recalled
from tests.experiments.people import Person, Shapes, remembered, with_extras

__all__ = [
    "drawn_by_anybody",
    "extras",
    "hall_drawing",
    "inventive_drawing",
    "seen_around",
    "strewn",
    "training_drawing",
    "turning",
]

_BY_PEOPLE = 0.25
_ELSEWHERE = 0.35
_OBJECTS = (3, 4, 5, 6, 8, 8, 12, 16, 20, 28, 36, 48, 60)
_DRAWN = (2, 3, 4, 5, 6, 7, 8, 8, 9, 10, 12)
_MANY_OBJECTS = (20, 28, 36, 48, 60)
_MANY_DRAWN = (14, 18, 24, 32, 45)
_EXTRAS = (0.65, 0.28, 0.07)
_INVENTED = (0.4, 0.4, 0.2)
_NEIGHBOURS = 0.8
_STRENGTHS = (0.5, 0.7, 0.95, 1.05, 1.2)
_TRIES = 200
_BETTER = 0.95


def training_drawing(number: int, many: bool = False) -> Drawing:
    """Return a sketch, a map, and the truth; −1 for all where the sketch is of another place.

    Parameters
    ----------
    number
        Which one.
    many
        Whether many things are drawn, which few people do.
    """
    rng = np.random.default_rng((271828, number, int(many)) if many else (271828, number))
    by_people = rng.random() < _BY_PEOPLE
    sizes = _MANY_OBJECTS if many else _OBJECTS[2:10] if by_people else _OBJECTS
    objects = int(rng.choice(sizes))
    furnish = random_scene if by_people else strewn
    map_ = furnish(rng, objects)
    elsewhere = rng.random() < _ELSEWHERE
    there = max(2, round(objects * rng.uniform(0.7, 1.4)))
    place = furnish(rng, there) if elsewhere else map_
    count = min(len(place), int(rng.choice(_MANY_DRAWN if many else _DRAWN)))
    kept = seen_around(place, count, rng)
    extra = int(rng.choice(3, p=_EXTRAS)) if count > 2 else 0
    sketch, truth = (_by_people if by_people else _by_anybody)(place, kept, extra, rng)
    order = rng.permutation(len(sketch))
    scene = Scene(tuple(sketch.objects[k] for k in order))
    return Drawing(scene, map_, np.full(len(order), -1) if elsewhere else truth[order])


def inventive_drawing(number: int, anything: bool = False) -> Drawing:
    """Return a sketch of this place, as :func:`training_drawing` does, by who invents more.

    Parameters
    ----------
    number
        Which one.
    anything
        Whether what is invented may be like nothing that is there.
    """
    rng = np.random.default_rng((161803, number, int(anything)) if anything else (161803, number))
    by_people = rng.random() < _BY_PEOPLE
    objects = int(rng.choice(_OBJECTS[3:10] if by_people else _OBJECTS[3:]))
    map_ = (random_scene if by_people else strewn)(rng, objects)
    kept = seen_around(map_, min(objects, int(rng.choice(_DRAWN[3:]))), rng)
    extra = int(rng.choice(3, p=_INVENTED))
    if by_people:
        sketch, truth = _by_people(map_, kept, extra, rng)
    else:
        sketch, truth = _by_anybody(map_, kept, extra, rng, anything)
    order = rng.permutation(len(sketch))
    return Drawing(Scene(tuple(sketch.objects[k] for k in order)), map_, truth[order])


def hall_drawing(number: int) -> Drawing:
    """Return a sketch of a hall by somebody who recalls it, as :func:`training_drawing` does."""
    rng = np.random.default_rng((141421, number))
    objects = int(rng.choice(_OBJECTS[2:]))
    map_ = hall(rng, objects)
    elsewhere = rng.random() < _ELSEWHERE
    place = hall(rng, max(4, round(objects * rng.uniform(0.7, 1.4)))) if elsewhere else map_
    count = min(len(place), int(rng.choice(_DRAWN[2:])))
    kept = seen_around(place, count, rng)
    things = [place.objects[k].rings[0] for k in kept]
    added = extras(place, things, int(rng.choice(3, p=_INVENTED)), rng)
    truth = np.array([*kept, *[-1] * len(added)])
    order = rng.permutation(len(truth))
    every = [*things, *added]
    scene = Scene.from_polygons(recalled([every[k] for k in order], place, rng))
    return Drawing(scene, map_, np.full(len(order), -1) if elsewhere else truth[order])


def seen_around(place: Scene, count: int, rng: np.random.Generator) -> IntArray:
    """Return some of what lies around one object, or of all there is."""
    centres = np.array([item.centroid for item in place.objects])
    nearest = np.argsort(np.hypot(*(centres - centres[rng.integers(len(place))]).T))
    forgotten = int(rng.choice(3, p=(0.5, 0.3, 0.2)))
    around: IntArray = nearest if rng.random() > _NEIGHBOURS else nearest[: count + forgotten]
    return rng.permutation(around)[:count]


def _by_people(
    place: Scene, kept: IntArray, extra: int, rng: np.random.Generator
) -> tuple[Scene, IntArray]:
    world = with_extras(place, extra, rng) if extra else place
    chosen = [*kept.tolist(), *range(len(place), len(world))]
    room = Scene(tuple(SceneObject(world.objects[k].rings, str(k)) for k in chosen))
    shapes = Shapes(rng.choice([str(each) for each in Shapes]))
    strength = float(rng.choice(_STRENGTHS))
    sketch = remembered(room, Person(strength, shapes=shapes), rng)
    drawn = np.array([int(item.label) for item in sketch.objects])
    bare = Scene(tuple(SceneObject(item.rings) for item in sketch.objects))
    return bare, np.where(drawn < len(place), drawn, -1)


def strewn(rng: np.random.Generator, objects: int) -> Scene:
    """Return things on a floor: alike or not, in rows, in clusters, or anyhow."""
    varied, elongated = rng.uniform(0.15, 0.7), rng.uniform(0.1, 0.7)
    straight, repeated, clustered = rng.random(3) < (0.5, 0.4, 0.3)
    kinds = [_kind(rng, varied, elongated) for _ in range(rng.integers(3, 9))]
    width = rng.uniform(1.6, 4.0)
    floor = width * math.sqrt(objects) * rng.uniform(0.9, 1.4) * np.array([1.0, 1.0])
    floor *= rng.uniform(0.6, 1.6) ** np.array([1.0, -1.0])
    middles = rng.uniform(0.0, 1.0, (max(2, objects // 6), 2)) * floor
    rings: list[FloatArray] = []
    circles = np.empty((objects, 3))
    tries = 0
    while len(rings) < objects:
        tries += 1
        if tries % 1000 == 0:
            floor = floor * 1.05
        again = repeated and rng.random() < 0.7
        kind = kinds[rng.integers(len(kinds))] if again else _kind(rng, varied, elongated)
        heading = rng.integers(4) * np.pi / 2.0 + rng.normal(0.0, 0.03)
        ring = _outline(rng, *kind) @ turning(heading if straight else rng.uniform(0.0, 7.0))
        centre = rng.uniform(0.0, 1.0, 2) * floor
        if clustered and rng.random() < 0.8:
            centre = middles[rng.integers(len(middles))] + rng.normal(0.0, 0.9 * width, 2)
        radius = float(np.hypot(*ring.T).max())
        others = circles[: len(rings)]
        if (np.hypot(*(others[:, :2] - centre).T) < others[:, 2] + radius + 0.08).any():
            continue
        circles[len(rings)] = (*centre, radius)
        rings.append(ring + centre)
    return Scene.from_polygons(rings)


def _kind(rng: np.random.Generator, varied: float, elongated: float) -> tuple[int, float, float]:
    """Return a shape, a size and an aspect."""
    shape = int(rng.choice(5, p=(0.45, 0.15, 0.2, 0.12, 0.08)))
    return shape, math.exp(rng.normal(0.0, varied)), math.exp(rng.normal(0.0, elongated))


def _outline(rng: np.random.Generator, shape: int, size: float, aspect: float) -> FloatArray:
    """Return a box, an ellipse, a blob, an L or a triangle."""
    match shape:
        case 0:
            ring = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
        case 1:
            ring = 0.5 * _around(np.arange(16) / 16.0)
        case 2:
            corners = int(rng.integers(5, 9))
            angles = (np.arange(corners) + rng.uniform(0.0, 0.5, corners)) / corners
            ring = 0.5 * _around(angles) * rng.uniform(0.45, 1.2, (corners, 1))
        case 3:
            w, h = rng.uniform(0.25, 0.6, 2)
            ring = np.array([[0, 0], [1, 0], [1, h], [w, h], [w, 1], [0, 1]]) - 0.5
        case _:
            ring = 0.6 * _around((np.arange(3) + rng.uniform(0.0, 0.3, 3)) / 3.0)
    stretched: FloatArray = ring * size * aspect ** np.array([0.5, -0.5])
    return stretched


def _by_anybody(
    place: Scene,
    kept: IntArray,
    extra: int,
    rng: np.random.Generator,
    anything: bool = False,
) -> tuple[Scene, IntArray]:
    """Draw with deviations of this sketch's own."""
    things = [place.objects[k].rings[0] for k in kept]
    added = extras(place, things, extra, rng, anything)
    truth = np.array([*kept, *[-1] * len(added)])
    strength = rng.uniform(0.3, 1.05)
    while True:
        try:
            return Scene.from_polygons(drawn_by_anybody([*things, *added], strength, rng)), truth
        except InvalidInputError:
            strength *= _BETTER


def extras(
    place: Scene,
    things: Sequence[FloatArray],
    count: int,
    rng: np.random.Generator,
    anything: bool = False,
) -> list[FloatArray]:
    """Return things like those of the place, or of any kind about as large, where nothing is."""
    corners = np.concatenate(things)
    low, high = corners.min(axis=0), corners.max(axis=0)
    there = [item.polygon for item in place.objects]
    found: list[FloatArray] = []
    for _ in range(_TRIES):
        if len(found) == count:
            break
        like = place.objects[rng.integers(len(place))].rings[0]
        if anything:
            size = math.sqrt(shapely.Polygon(like).area)
            like = _outline(rng, *_kind(rng, 0.3, 0.4)) * size
        ring = (like - like.mean(axis=0)) @ turning(rng.uniform(0.0, 7.0))
        ring = ring * math.exp(rng.normal(0.0, 0.2)) + rng.uniform(low, high)
        outline = shapely.Polygon(ring)
        if shapely.distance(there, outline).min() > 0.05:
            there.append(outline)
            found.append(ring)
    return found


def drawn_by_anybody(
    things: Sequence[FloatArray], strength: float, rng: np.random.Generator
) -> list[FloatArray]:
    """Return things as they are drawn."""
    centres = np.array([shapely.Polygon(ring).centroid.coords[0] for ring in things])
    middle = centres.mean(axis=0)
    extent = 2.0 * float(np.abs(centres - middle).max()) + 1e-9
    apart = np.hypot(*(centres[:, None] - centres).transpose(2, 0, 1))
    np.fill_diagonal(apart, np.inf)
    displaced = strength * rng.uniform(0.03, 0.28) * float(apart.min(axis=1).mean())
    sized, stretched, turned = strength * rng.uniform((0.03, 0.02, 0.02), (0.3, 0.25, 0.2))
    evenly, simple = rng.random() < 0.3, int(rng.choice(3, p=(0.6, 0.25, 0.15)))
    gradient = rng.normal(0.0, 0.12, 2)
    small = math.exp(rng.normal(0.0, 0.15)) if rng.random() < 0.7 else rng.uniform(0.4, 0.9)
    along = turning(rng.uniform(0.0, np.pi))
    page = along.T @ np.diag(np.exp(rng.normal(0.0, rng.uniform(0.0, 0.15)) * np.array([1, -1])))
    page = page @ along @ turning(rng.uniform(0.0, 7.0)) * math.exp(rng.uniform(-1.0, 4.0))
    # Some people draw all with the same care, others one thing well and the next anyhow.
    uneven = rng.choice((0.0, rng.uniform(0.0, 0.7)))
    rings = []
    for ring, centre in zip(things, centres, strict=True):
        careless = np.exp(rng.normal(0.0, uneven, 4))
        outline = _simplified(ring - centre, simple)
        if evenly:
            outline = outline * (1.0 + 1.3 * stretched * rng.uniform(-1.0, 1.0, 2))
        else:
            outline = outline * np.exp(careless[0] * rng.normal(0.0, stretched, 2))
        growth = float(gradient @ (centre - middle)) / extent
        outline = outline @ turning(careless[1] * rng.normal(0.0, turned))
        outline = outline * small * math.exp(careless[2] * rng.normal(0.0, sized) + growth)
        where = (centre - middle) * math.exp(growth / 2.0)
        where = where + careless[3] * rng.normal(0.0, displaced, 2)
        rings.append((outline + where) @ page)
    return rings


def _simplified(ring: FloatArray, simple: int) -> FloatArray:
    """Return an outline, or a box or an ellipse about as large."""
    if simple == 0:
        return ring
    polygon = shapely.Polygon(ring)
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(polygon))[:-1]
    frame = np.stack([corners[1] - corners[0], corners[2] - corners[1]])
    box = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    around: FloatArray = (box if simple == 1 else 0.5 * _around(np.arange(16) / 16.0)) @ frame
    return around * math.sqrt(polygon.area / shapely.Polygon(around).area)


def _around(turns: FloatArray) -> FloatArray:
    """Return points of the unit circle."""
    return np.stack([np.cos(2.0 * np.pi * turns), np.sin(2.0 * np.pi * turns)], axis=1)


def turning(angle: float) -> FloatArray:
    """Return the matrix by which rows of points are turned clockwise."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])
