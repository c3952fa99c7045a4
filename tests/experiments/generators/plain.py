"""Things strewn over a floor, and people who displace and stretch each of them on its own.

No number of the engine was or will be learned from this: it is what the study measures with.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from sketchmatch.model import FloatArray, Scene
from tests.experiments.generators import outlines
from tests.experiments.people import Shapes

__all__ = ["drawn", "furnished", "thing"]

_STRETCH = 0.25
# Of the width of a thing's place on the floor, which is 1.
_DISPLACEMENT = 0.22
_SIZE = 0.45
_SIZES = 0.35
_ASPECTS = 0.35
_GAP = 0.08
_BETWEEN_CENTRES = 0.7
_TRIES = 20
_BETTER = 0.95


def furnished(rng: np.random.Generator, objects: int) -> list[FloatArray]:
    """Return the outlines of a map: shapes of several kinds on a floor of one place for each."""
    floor = np.sqrt(objects) * np.exp(np.array([1.0, -1.0]) * rng.uniform(-0.25, 0.25))
    placed: list[FloatArray] = []
    polygons: list[shapely.Polygon] = []
    centres = np.empty((objects, 2))
    while len(placed) < objects:
        centre = rng.uniform(0.0, floor)
        if (np.hypot(*(centres[: len(placed)] - centre).T) < _BETWEEN_CENTRES).any():
            continue
        ring = thing(rng) + centre
        outline = shapely.Polygon(ring)
        if polygons and shapely.distance(polygons, outline).min() < _GAP:
            continue
        centres[len(placed)] = centre
        placed.append(ring)
        polygons.append(outline)
    return placed


def thing(rng: np.random.Generator) -> FloatArray:
    """Return the outline of a thing around the origin, of any kind and size."""
    aspect = float(np.exp(rng.normal(0.0, _ASPECTS)))
    kind = rng.integers(4)
    if kind == 0:
        ring = outlines.box(aspect)
    elif kind == 1:
        ring = outlines.ellipse(aspect)
    elif kind == 2:
        ring = outlines.l_shape(aspect, rng.uniform(0.35, 0.6))
    else:
        ring = outlines.polygon(rng, int(rng.integers(5, 8)))
    straight = rng.random() < 0.5
    heading = outlines.TURNS * (rng.integers(4) / 4.0 if straight else rng.random())
    size = _SIZE * float(np.exp(rng.normal(0.0, _SIZES)))
    return outlines.turned(ring, heading) * size


def drawn(
    things: Sequence[FloatArray],
    room: Scene,  # noqa: ARG001
    shapes: Shapes,
    rng: np.random.Generator,
) -> list[FloatArray]:
    """Return things as they are drawn, turned anyhow.

    Where drawn things meet, all are drawn again, and after many tries a little better.
    """
    simple = [outlines.simplified(ring, shapes) for ring in things]
    centres = np.array([ring.mean(axis=0) for ring in simple])
    care = 1.0
    while True:
        for _ in range(_TRIES):
            places = centres + rng.normal(0.0, care * _DISPLACEMENT, centres.shape)
            stretches = 1.0 + care * rng.uniform(-_STRETCH, _STRETCH, centres.shape)
            rings = [
                (ring - centre) * stretch + place
                for ring, centre, stretch, place in zip(
                    simple, centres, stretches, places, strict=True
                )
            ]
            if outlines.apart(rings):
                heading = rng.uniform(0.0, outlines.TURNS)
                scale = float(np.exp(rng.uniform(-1.0, 1.0)))
                return [outlines.turned(ring, heading) * scale for ring in rings]
        care *= _BETTER
