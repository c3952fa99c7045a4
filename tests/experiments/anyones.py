"""Anyone's sketches of any place: every kind of place to learn from, by every kind of person.

What is learned from halls by those who recall halls holds for these; where places and people are
paired anew, nothing about the one tells who the other is. Hands tremble, and robots see roughly,
and of some things one side alone: of some sketches, and of some maps, outlines are rough, and of
some maps a few things are thinner than they are. Of some sketches the place is another one by the
same builder.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np
import shapely

from sketchmatch.errors import InvalidInputError
from sketchmatch.model import FloatArray, IntArray, Scene, SceneObject
from sketchmatch.testing import random_scene
from tests.experiments.crowd import (
    Style,
    drawn_by_somebody,
    invented,
    kept_of,
    place_of,
    style_of,
)
from tests.experiments.drawings import Drawing
from tests.experiments.halls import hall, recalled
from tests.experiments.people import Person, Shapes, remembered
from tests.experiments.training import drawn_by_anybody, extras, seen_around, strewn, turning

__all__ = ["anyones_drawing"]

_OBJECTS = (5, 6, 7, 8, 8, 10, 12, 16, 20, 20, 24, 28, 36, 44, 52, 60)
_DRAWN = (4, 5, 6, 6, 7, 7, 8, 8, 8, 9, 10, 12)
_NEARLY_ALL = 0.3
_EXTRAS = (0.42, 0.36, 0.17, 0.05)
_ELSEWHERE = 0.3
_MOST_AT_RANDOM = 24
_BETTER = 0.95
_TRIES = 12
_ONE_SIDED = 0.25
"""Of how many maps some things are seen from one side."""

_ROUGH = 0.5, 0.4
_ROUGHEST = 0.16
_BENDS = 6
_POINTS = 12
"""Of how many sketches, and maps, outlines are rough; how rough at most, as a share of how far each
corner is from the middle; by how many waves, and by how many points there are at least."""

_Builder: TypeAlias = Callable[[int, np.random.Generator], Scene]


def anyones_drawing(number: int, exchanged: bool = False) -> Drawing:
    """Return a sketch, a map, and the truth; −1 for all where the sketch is of another place.

    Parameters
    ----------
    number
        Which one.
    exchanged
        Whether what is drawn and not on the map stands where something else was when the map was
        made.
    """
    rng = np.random.default_rng((264575, number, 1) if exchanged else (264575, number))
    style, count = style_of(rng), int(rng.choice(_DRAWN))
    objects = int(rng.choice(_OBJECTS))
    if rng.random() < _NEARLY_ALL:
        objects = max(4, count + int(rng.integers(-1, 4)))
    build = _builder(style, objects, rng)
    map_ = build(objects, rng)
    roughness = np.where(rng.random(2) < _ROUGH, rng.uniform(0.0, _ROUGHEST, 2), 0.0)
    elsewhere = rng.random() < _ELSEWHERE
    place = build(max(4, round(objects * rng.uniform(0.7, 1.4))), rng) if elsewhere else map_
    if rng.random() < 0.5:
        kept, seen = kept_of(place, min(count, len(place)), rng)
    else:
        kept = seen_around(place, min(count, len(place)), rng)
        seen = kept
    extra = int(rng.choice(len(_EXTRAS), p=_EXTRAS)) if len(kept) > 3 else 0
    things = [place.objects[k].rings[0] for k in kept]
    if exchanged:
        added = _exchanged(place, kept, rng)
    elif rng.random() < 0.6:
        added = invented(style, place, seen, kept, extra, rng)
    else:
        added = extras(place, things, extra, rng, bool(rng.random() < 0.5))
    truth = np.array([*kept, *[-1] * len(added)])
    order = rng.permutation(len(truth))
    every = [*things, *added]
    sketch = _drawn([every[k] for k in order], place, rng)
    map_ = _as_seen(map_, rng)
    sketch, map_ = (_rough(*each, rng) for each in zip((sketch, map_), roughness, strict=True))
    return Drawing(sketch, map_, np.full(len(order), -1) if elsewhere else truth[order])


def _exchanged(place: Scene, kept: IntArray, rng: np.random.Generator) -> list[FloatArray]:
    """Return one thing or two where nearby things were that are not drawn, and unlike these."""
    centres = np.array([item.centroid for item in place.objects])
    rest = np.setdiff1d(np.arange(len(place)), kept)
    far = np.hypot(*(centres[rest] - centres[kept].mean(axis=0)).T)
    drawn = [place.objects[k].polygon for k in kept]
    found: list[FloatArray] = []
    for k in rest[np.argsort(far, kind="stable")][: rng.integers(1, 3)]:
        like = place.objects[rng.integers(len(place))].rings[0]
        unit = math.sqrt(place.objects[k].area)
        ring = (like - like.mean(axis=0)) @ turning(rng.uniform(0.0, 7.0))
        at = centres[k] + rng.normal(0.0, 0.3 * unit, 2)
        for _ in range(_TRIES):
            outline = shapely.Polygon(ring + at)
            if shapely.distance(drawn, outline).min() > 0.0:
                found.append(ring + at)
                drawn.append(outline)
                break
            ring = 0.9 * ring
    return found


def _rough(scene: Scene, roughness: float, rng: np.random.Generator) -> Scene:
    """Return a scene with outlines that are nearer to the middles here and farther there."""
    if not roughness:
        return scene
    polygons = [item.polygon for item in scene.objects]
    found = []
    for k, (item, polygon) in enumerate(zip(scene.objects, polygons, strict=True)):
        corners = shapely.get_coordinates(shapely.segmentize(polygon, polygon.length / _POINTS))
        ways = corners[:-1] - item.centroid
        waves, phases = np.arange(1, _BENDS + 1), rng.uniform(0.0, 7.0, _BENDS)
        angles = np.arctan2(*ways.T)[:, None] * waves + phases
        rough = np.exp(roughness * np.cos(angles) @ (rng.normal(0.0, 1.0, _BENDS) / np.sqrt(waves)))
        ring = item.centroid + ways * rough[:, None]
        outline = shapely.Polygon(ring)
        others = [*polygons[:k], *polygons[k + 1 :]]
        apart = outline.is_valid and not shapely.intersects(others, outline).any()
        found.append(ring if apart else item.rings[0])
        polygons[k] = outline if apart else polygon
    return Scene.from_polygons(found)


def _as_seen(scene: Scene, rng: np.random.Generator) -> Scene:
    """Return a map in which, of a few things, only what faces the robot is."""
    if rng.random() > _ONE_SIDED:
        return scene
    hidden = rng.uniform(0.05, 0.4)
    found = []
    for item in scene.objects:
        ring = item.rings[0]
        if rng.random() < hidden:
            box = shapely.get_coordinates(shapely.minimum_rotated_rectangle(item.polygon))
            long, wide = sorted(np.diff(box[:3], axis=0), key=lambda side: -float(np.hypot(*side)))
            across = (wide if rng.random() < 0.75 else long) * rng.choice((-1.0, 1.0))
            # All that lies deeper than this is not seen.
            depths = ring @ across
            far = depths.min() + rng.uniform(0.15, 0.7) * np.ptp(depths)
            front = far / (across @ across) * across
            along = 1e3 * np.array([-across[1], across[0]])
            half = shapely.Polygon(
                [
                    front + along,
                    front - along,
                    front - along - 1e3 * across,
                    front + along - 1e3 * across,
                ]
            )
            seen = shapely.intersection(item.polygon, half)
            if seen.geom_type == "Polygon":
                ring = shapely.get_coordinates(seen)[:-1]
        found.append(ring)
    return Scene.from_polygons(found)


def _builder(style: Style, objects: int, rng: np.random.Generator) -> _Builder:
    kind = int(rng.choice(4, p=(0.15, 0.25, 0.25, 0.35)))
    match kind if objects <= _MOST_AT_RANDOM or kind else 1:
        case 0:
            return lambda count, rng: random_scene(rng, min(count, _MOST_AT_RANDOM))
        case 1:
            return lambda count, rng: strewn(rng, count)
        case 2:
            return lambda count, rng: hall(rng, count)
        case _:
            return lambda count, rng: place_of(style, count, rng)


def _drawn(things: Sequence[FloatArray], place: Scene, rng: np.random.Generator) -> Scene:
    match int(rng.choice(5, p=(0.2, 0.25, 0.2, 0.2, 0.15))):
        case 0:
            return _remembered(things, rng)
        case 1:
            return _by_anybody(things, rng)
        case 2:
            return Scene.from_polygons(recalled(things, place, rng))
        case kind:
            return Scene.from_polygons(drawn_by_somebody(things, rng, kind == 4))


def _remembered(things: Sequence[FloatArray], rng: np.random.Generator) -> Scene:
    room = Scene(tuple(SceneObject.from_rings([ring], str(k)) for k, ring in enumerate(things)))
    shapes = Shapes(rng.choice([str(each) for each in Shapes]))
    small = 1.0 if rng.random() < 0.5 else rng.uniform(0.5, 1.0)
    person = Person(rng.uniform(0.4, 1.25), shapes=shapes, small=small)
    try:
        sketch = remembered(room, person, rng)
    except ValueError:  # things that reach around each other are no boxes
        sketch = remembered(room, replace(person, shapes=Shapes.OUTLINES), rng)
    drawn = sorted(sketch.objects, key=lambda item: int(item.label))
    return Scene(tuple(SceneObject(item.rings) for item in drawn))


def _by_anybody(things: Sequence[FloatArray], rng: np.random.Generator) -> Scene:
    strength = rng.uniform(0.3, 1.05)
    while True:
        try:
            return Scene.from_polygons(drawn_by_anybody(things, strength, rng))
        except InvalidInputError:
            strength *= _BETTER
