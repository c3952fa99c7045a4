"""How people draw a room they remember: a documented model with one dial, ``strength``.

What is known of sketch maps is that they keep order and direction better than distance and size,
straighten and simplify, and differ from person to person. At strength 1, before the pen:

- the whole is turned anyhow, or is ``upright``; its size is the room's, which nothing sees;
- the page stretches it, along one direction more than across (``page``);
- one side comes out larger than the other: the scale grows evenly across the room (``gradient``);
- each object is displaced (``displacement``, of the typical spacing), turned (``turn``), drawn too
  large or small (``size``) and too long or short (``stretch``); but what stands apart stays apart:
  where drawn objects would meet, the room is remembered again, a little better;
- outlines are simplified (``simplify``) and wobble smoothly (``wobble``);
- the pen rounds corners, swings past them, trembles, stops up to 3 % of an outline before where it
  began or up to 3 % too late, and has drifted by 3 ‰ of the page, whatever the strength. (With
  twice this drift the segmenter leaves an object open in 6 % of all sketches.)

Things may be drawn ``small``: so many times as large as they are, between places that are as far
apart as ever, as people do who leave room between what they draw.

``Shapes`` says whether an outline is drawn at all: people who draw a box, or an ellipse, for
everything keep its place, its size and its direction.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
import shapely

from sketchmatch.model import FloatArray, Scene, SceneObject, StrokeSet
from sketchmatch.testing import draw_strokes, simulate_sketch

__all__ = ["EXTRA", "Person", "Shapes", "draw", "remembered", "with_extras"]

EXTRA = "extra"
"""What labels of objects begin with that are drawn and not there."""

_TRIES = 20
_EXACT = 0.1
_BETTER = 0.97
_CLEARANCE = 0.35
_GAP = (-0.03, 0.03)
_DRIFT = 0.003
_CORNERS = 32


class Shapes(StrEnum):
    """What people draw for a thing: its outline, or a box or an ellipse about as large."""

    OUTLINES = "outlines"
    BOXES = "boxes"
    ELLIPSES = "ellipses"


@dataclass(frozen=True)
class Person:
    """How far drawings leave the truth, as standard deviations at strength 1.

    Attributes
    ----------
    strength
        Multiplies all of the others.
    page, gradient
        Of the logarithm of the page's stretch, and of the change of scale across the room.
    displacement
        Of an object's shift along x and y, as a share of the typical distance between neighbours.
    turn
        Of an object's own turn, in radians.
    size, stretch
        Of the logarithms of an object's own scale, and of that along its x and y.
    simplify
        How far a simplified outline leaves the true one, as a share of the root of its area.
    wobble
        Of an outline, as a share of the object's size.
    small
        How many times as large as it is an object is drawn, whatever the strength.
    upright
        Whether the whole is as the room lies, and not turned anyhow.
    shapes
        Whether outlines are drawn.
    """

    strength: float
    page: float = 0.06
    gradient: float = 0.12
    displacement: float = 0.15
    turn: float = 0.15
    size: float = 0.15
    stretch: float = 0.15
    simplify: float = 0.06
    wobble: float = 0.08
    small: float = 1.0
    upright: bool = False
    shapes: Shapes = Shapes.OUTLINES


def draw(
    room: Scene, person: Person, rng: np.random.Generator, objects: Sequence[int] | None = None
) -> StrokeSet:
    """Draw a room as a person might.

    Parameters
    ----------
    room
        What there is to draw.
    person
        How far from the truth.
    rng
        Source of randomness.
    objects
        Indices of what is drawn; all when left out.

    Returns
    -------
    StrokeSet
        One stroke an object in random order, labelled as the object is.
    """
    drawn = [*range(len(room))] if objects is None else objects
    chosen = Scene(tuple(room.objects[k] for k in drawn))
    return draw_strokes(remembered(chosen, person, rng), rng, gap=_GAP, drift=_DRIFT)


def remembered(room: Scene, person: Person, rng: np.random.Generator) -> Scene:
    """Return a room as a person remembers it, in random order: what is drawn, before the pen.

    Raises
    ------
    ValueError
        If objects meet even as somebody draws them who knows all: boxes around things that reach
        around each other.
    """
    strength = person.strength
    while True:
        for _ in range(_TRIES):
            sketch = _remembered(room, person, strength, rng)
            if _apart(sketch):
                return sketch
        if strength < _EXACT:
            raise ValueError(f"things of this room meet where they are drawn as {person.shapes}")
        strength *= _BETTER


def with_extras(room: Scene, count: int, rng: np.random.Generator) -> Scene:
    """Return the room with things in it that are not there, clear of all others."""
    objects = list(room.objects)
    x0, y0, x1, y1 = room.bounds
    while len(objects) < len(room) + count:
        size, centre = rng.uniform(0.5, 1.3, 2), rng.uniform([x0, y0], [x1, y1])
        ring = _turned(_ellipse() if rng.random() < 0.3 else _box(), rng) * size + centre
        if all(shapely.Polygon(ring).distance(item.polygon) > _CLEARANCE for item in objects):
            label = f"{EXTRA} {len(objects) - len(room) + 1}"
            objects.append(SceneObject.from_rings([ring], label))
    return Scene(tuple(objects))


def _remembered(room: Scene, person: Person, strength: float, rng: np.random.Generator) -> Scene:
    """Return the room as it is drawn, before the pen."""
    page = _page_stretch(rng, strength * person.page)
    gradient = rng.normal(0.0, strength * person.gradient, 2)
    x0, y0, x1, y1 = room.bounds
    middle, extent = np.array([x0 + x1, y0 + y1]) / 2.0, math.hypot(x1 - x0, y1 - y0)
    objects = []
    for item in room.objects:
        simple = _simplified(item, person.shapes, strength * person.simplify)
        centre = np.array(item.centroid)
        growth = float(gradient @ (centre - middle)) / extent
        size = person.small * math.exp(growth + rng.normal(0.0, strength * person.size))
        place = (centre - middle) * math.exp(growth / 2.0)
        ring = ((simple - centre) * size + place) @ page.T
        objects.append(SceneObject.from_rings([ring], item.label))
    return simulate_sketch(
        Scene(tuple(objects)),
        rng,
        rotation=0.0 if person.upright else None,
        scale=1.0,
        displacement=strength * person.displacement,
        turn=strength * person.turn,
        stretch=strength * person.stretch,
        wobble=strength * person.wobble,
    ).scene


def _page_stretch(rng: np.random.Generator, deviation: float) -> FloatArray:
    """Return the matrix that stretches along one direction and shrinks across it."""
    angle, stretch = rng.uniform(0.0, np.pi), rng.normal(0.0, deviation)
    along = np.array([math.cos(angle), math.sin(angle)])
    across = np.array([-along[1], along[0]])
    stretched: FloatArray = math.exp(stretch) * np.outer(along, along)
    stretched += math.exp(-stretch) * np.outer(across, across)
    return stretched


def _simplified(item: SceneObject, shapes: Shapes, tolerance: float) -> FloatArray:
    """Return an object's outline as somebody remembers it, shape (k, 2)."""
    if shapes is Shapes.OUTLINES:
        coarse = item.polygon.simplify(tolerance * math.sqrt(item.area))
        return _corners(coarse)
    around = _corners(shapely.minimum_rotated_rectangle(item.polygon))
    centre = np.array(item.centroid)
    frame = np.stack([around[1] - around[0], around[2] - around[1]])
    outline = _box() if shapes is Shapes.BOXES else _ellipse()
    ring = outline @ frame
    kept = math.sqrt(item.area / shapely.Polygon(ring).area)
    simple: FloatArray = centre + kept * ring
    return simple


def _apart(scene: Scene) -> bool:
    """Whether no two objects meet."""
    shapes = [item.polygon for item in scene.objects]
    return not any(shapes[a].intersects(shapes[b]) for a in range(len(shapes)) for b in range(a))


def _corners(polygon: Any) -> FloatArray:
    corners: FloatArray = shapely.get_coordinates(polygon)[:-1]
    return corners


def _box() -> FloatArray:
    return np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])


def _ellipse() -> FloatArray:
    angles = np.arange(_CORNERS) * (2.0 * np.pi / _CORNERS)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1) / 2.0


def _turned(outline: FloatArray, rng: np.random.Generator) -> FloatArray:
    angle = rng.uniform(0.0, 2.0 * np.pi)
    c, s = math.cos(angle), math.sin(angle)
    turned: FloatArray = outline @ np.array([[c, s], [-s, c]])
    return turned
