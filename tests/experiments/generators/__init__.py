"""Sketches to measure with, by two generators that are different in kind from ``people``.

- ``plain``: things strewn over a floor, each displaced and stretched on its own;
- ``memory``: furnished rooms along a corridor, remembered by order, alignment and classes of size.

No number of the engine was or will be learned from either of them: what is learned is learned from
:mod:`tests.experiments.drawings`, whose rooms and people are others.
"""

from __future__ import annotations

from types import MappingProxyType, ModuleType

import numpy as np
import shapely

from sketchmatch.model import FloatArray, IntArray, Scene
from tests.experiments.drawings import Drawing
from tests.experiments.generators import memory, plain
from tests.experiments.people import Shapes

__all__ = ["KINDS", "sample"]

_GENERATORS = MappingProxyType({"plain": plain, "memory": memory})

KINDS = tuple(_GENERATORS)
"""The names of the generators."""

_SEED = 1609
_HERE, _ELSEWHERE, _SKETCH = range(3)
_CLEAR = 0.04
_TRIES = 30
_SMALLER = 0.85


def sample(
    kind: str,
    number: int,
    *,
    objects: int = 20,
    drawn: int = 8,
    missing: int = 0,
    extra: int = 0,
    wrong_place: bool = False,
    shapes: Shapes = Shapes.OUTLINES,
) -> Drawing:
    """Return a sketch of a part of a map, the map, and the truth; the same for the same numbers.

    Parameters
    ----------
    kind
        One of :data:`KINDS`.
    number
        Which one. The same map comes with the same number, however it is drawn.
    objects
        Of the map.
    drawn
        How many neighbours somebody sees, of which the sketch shows all but the missing ones.
    missing, extra
        How many of these are forgotten, and how many things are drawn that are not there.
    wrong_place
        Whether the sketch is of another map of the same kind, with as many objects.
    shapes
        Whether outlines are drawn, or a box or an ellipse for everything.

    Returns
    -------
    Drawing
        Both scenes in random order. The truth is −1 for what is not on the map: of a wrong place,
        for everything.
    """
    generator = _GENERATORS[kind]
    source = [_SEED, KINDS.index(kind), objects, number]
    map_ = _map(generator, objects, [*source, _HERE])
    place = _map(generator, objects, [*source, _ELSEWHERE]) if wrong_place else map_
    what = [drawn, missing, extra, int(wrong_place), [*Shapes].index(shapes)]
    rng = np.random.default_rng([*source, _SKETCH, *what])
    seen = _neighbours(place, min(drawn, objects), rng)
    kept = rng.permutation(seen)[missing:]
    things = [place.objects[k].rings[0] for k in kept]
    things += _extras(generator, place, seen, extra, rng)
    truth = np.array([*(np.full(len(kept), -1) if wrong_place else kept), *[-1] * extra])
    order = rng.permutation(len(things))
    rings = generator.drawn([things[k] for k in order], place, shapes, rng)
    return Drawing(Scene.from_polygons(rings), map_, truth[order])


def _map(generator: ModuleType, objects: int, seed: list[int]) -> Scene:
    rng = np.random.default_rng(seed)
    rings: list[FloatArray] = generator.furnished(rng, objects)
    return Scene.from_polygons([rings[k] for k in rng.permutation(objects)])


def _neighbours(place: Scene, count: int, rng: np.random.Generator) -> IntArray:
    """Return a random object and the ones nearest to it."""
    centres = np.array([item.centroid for item in place.objects])
    seed = centres[rng.integers(len(centres))]
    nearest: IntArray = np.argsort(np.hypot(*(centres - seed).T))[:count]
    return nearest


def _extras(
    generator: ModuleType, place: Scene, seen: IntArray, count: int, rng: np.random.Generator
) -> list[FloatArray]:
    """Return things that are not there, among what is seen and clear of all there is."""
    region = shapely.MultiPoint([place.objects[k].centroid for k in seen]).convex_hull
    low, high = np.array(region.bounds).reshape(2, 2)
    there = [item.polygon for item in place.objects]
    found: list[FloatArray] = []
    size = 1.0
    while len(found) < count:
        for _ in range(_TRIES):
            ring = generator.thing(rng) * size + rng.uniform(low, high)
            outline = shapely.Polygon(ring)
            inside = region.contains(outline.centroid)
            if inside and shapely.distance(there, outline).min() > _CLEAR:
                found.append(ring)
                there.append(outline)
                break
        else:
            size *= _SMALLER
    return found
