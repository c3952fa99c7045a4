"""Sketches to check with what was learned: other places, and people who draw step by step.

Nothing is learned from these but how often the right map is not known. What the study measures with
is again made otherwise, by ``tests.experiments.generators``. A floor is divided again and again,
and one thing stands in each part. Who draws it goes from each thing to the next, by how far and in
which direction it is from one that is drawn already, so that errors add up on the way; and a size
is remembered by how much larger the thing is than that one.
"""

from __future__ import annotations

import math

import numpy as np
import shapely

from sketchmatch.model import FloatArray, IntArray, Scene
from tests.experiments.drawings import Drawing

__all__ = ["stranger_drawing"]

_OBJECTS = (8, 8, 12, 20, 20, 28, 36, 60)
_DRAWN = (5, 6, 7, 8, 8, 9)
_FORGOTTEN = (0.45, 0.35, 0.2)
_EXTRAS = (0.5, 0.35, 0.15)
_ELSEWHERE = 0.3
_CLEAR = 0.02
_BETTER = 0.93


def stranger_drawing(number: int) -> Drawing:
    """Return a sketch, a map, and the truth; −1 for all where the sketch is of another place."""
    rng = np.random.default_rng((223606, number))
    objects, count = int(rng.choice(_OBJECTS)), int(rng.choice(_DRAWN))
    map_ = _divided(objects, rng)
    elsewhere = rng.random() < _ELSEWHERE
    place = _divided(objects, rng) if elsewhere else map_
    centres = np.array([item.centroid for item in place.objects])
    around = np.argsort(np.hypot(*(centres - centres[rng.integers(objects)]).T))
    forgotten = int(rng.choice(3, p=_FORGOTTEN))
    seen: IntArray = rng.permutation(around[: count + forgotten])
    kept = seen[: max(3, min(count, len(seen) - forgotten))]
    things = [place.objects[k].rings[0] for k in kept]
    added = _beside(
        [item.rings[0] for item in place.objects], seen, int(rng.choice(3, p=_EXTRAS)), rng
    )
    truth = np.array([*kept, *[-1] * len(added)])
    order = rng.permutation(len(truth))
    every = [*things, *added]
    sketch = Scene.from_polygons(_step_by_step([every[k] for k in order], rng))
    return Drawing(sketch, map_, np.full(len(order), -1) if elsewhere else truth[order])


def _divided(objects: int, rng: np.random.Generator) -> Scene:
    """Return things that stand in the parts of a floor."""
    side = math.sqrt(objects)
    parts = [np.array([0.0, 0.0, side * rng.uniform(0.7, 1.4), side])]
    while len(parts) < objects:
        areas = np.array([part[2] * part[3] for part in parts])
        x, y, width, height = parts.pop(int(rng.choice(len(parts), p=areas**2 / (areas**2).sum())))
        share = rng.uniform(0.3, 0.7)
        if width * rng.uniform(0.7, 1.4) > height:
            parts += [
                np.array([x, y, share * width, height]),
                np.array([x + share * width, y, (1.0 - share) * width, height]),
            ]
        else:
            parts += [
                np.array([x, y, width, share * height]),
                np.array([x, y + share * height, width, (1.0 - share) * height]),
            ]
    full = rng.uniform(0.35, 0.8)
    rings = []
    for x, y, width, height in parts:
        extent = np.array([width, height]) * full * rng.uniform(0.5, 1.0, 2)
        spare = np.array([width, height]) - extent
        centre = np.array([x, y]) + extent / 2.0 + spare * rng.uniform(0.1, 0.9, 2)
        rings.append(_form(rng) * extent + centre)
    return Scene.from_polygons([rings[k] for k in rng.permutation(objects)])


def _form(rng: np.random.Generator) -> FloatArray:
    """Return an outline within the square of side 1: of a chest, a tub, a piano, a corner."""
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    kind = rng.random()
    if kind < 0.5:
        return corners
    angles = np.linspace(0.0, 2.0 * np.pi, 14, endpoint=False)
    if kind < 0.7:
        return np.column_stack([np.cos(angles), np.sin(angles)]) / 2.0
    cut = rng.uniform(0.2, 0.7, 2)
    ring = np.array([[0, 0], [1, 0], [1, cut[1]], [cut[0], cut[1]], [cut[0], 1], [0, 1]]) - 0.5
    if kind < 0.85:
        ring = np.delete(ring, 3, axis=0)
    return ring * rng.choice((-1.0, 1.0), 2)


def _beside(
    there: list[FloatArray], seen: IntArray, count: int, rng: np.random.Generator
) -> list[FloatArray]:
    """Return things that are not there, each in a gap beside something that is seen."""
    outlines = [shapely.Polygon(ring) for ring in there]
    found: list[FloatArray] = []
    size = 0.6
    while len(found) < count:
        near = outlines[rng.choice(seen)].centroid
        way = rng.uniform(0.4, 1.2) * np.array([math.cos(a := rng.uniform(0.0, 7.0)), math.sin(a)])
        ring = _form(rng) * size * rng.uniform(0.5, 1.2, 2) + [near.x, near.y] + way
        outline = shapely.Polygon(ring)
        if shapely.distance(outlines, outline).min() > _CLEAR:
            found.append(ring)
            outlines.append(outline)
        size *= 0.99
    return found


def _step_by_step(things: list[FloatArray], rng: np.random.Generator) -> list[FloatArray]:
    polygons = [shapely.Polygon(ring) for ring in things]
    centres = shapely.get_coordinates(shapely.centroid(polygons))
    sizes = np.log(shapely.area(polygons)) / 2.0
    aside, farther, larger = rng.uniform((0.03, 0.03, 0.03), (0.3, 0.3, 0.25))
    longer, boxes, smaller = rng.uniform(0.0, 0.2), rng.random() < 0.35, rng.normal(-0.1, 0.15)
    page = rng.uniform(0.0, 7.0)
    care = 1.0
    while True:
        places, drawn = np.zeros(centres.shape), np.zeros(len(things))
        known, rest = [0], [*range(1, len(things))]
        while rest:
            apart = np.hypot(*(centres[rest][:, None] - centres[known]).transpose(2, 0, 1))
            a, b = np.unravel_index(apart.argmin(), apart.shape)
            thing, anchor = rest.pop(int(a)), known[int(b)]
            way = centres[thing] - centres[anchor]
            longer_way = math.exp(care * rng.normal(0.0, farther))
            places[thing] = places[anchor] + longer_way * _turned(
                way, care * rng.normal(0.0, aside)
            )
            drawn[thing] = 0.6 * drawn[anchor] + care * rng.normal(0.0, larger)
            known.append(thing)
        rings = []
        for k, ring in enumerate(things):
            outline = ring - centres[k]
            if boxes:
                half = np.ptp(outline, axis=0) / 2.0
                outline = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * half
                outline = outline * math.exp(sizes[k]) / math.sqrt(4.0 * half.prod())
            outline = outline * np.exp(care * rng.normal(0.0, longer) * np.array([1.0, -1.0]))
            rings.append(outline * math.exp(drawn[k] + smaller) + places[k])
        outlines = [shapely.Polygon(ring) for ring in rings]
        first, second = shapely.STRtree(outlines).query(outlines, predicate="intersects")
        if (first == second).all():
            return [_turned(ring, page) for ring in rings]
        care, smaller = care * _BETTER, smaller - 0.02


def _turned(points: FloatArray, angle: float) -> FloatArray:
    """Return points turned counter-clockwise about the origin."""
    c, s = math.cos(angle), math.sin(angle)
    turned: FloatArray = points @ np.array([[c, s], [-s, c]])
    return turned
