"""Simulated sketches with known truth: what a person might draw of a scene.

The model of how people draw: the whole is turned, scaled and moved; each object is displaced by
a share of the scene's spacing, turned and stretched a little; outlines wobble smoothly.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sketchmatch.errors import InvalidInputError
from sketchmatch.model import FloatArray, IntArray, Scene, SceneObject

__all__ = ["SimulatedSketch", "random_scene", "simulate_sketch", "spacing"]


@dataclass(frozen=True)
class SimulatedSketch:
    """A sketch and the truth about it.

    Attributes
    ----------
    scene
        The sketched objects, in random order.
    partners
        Shape (N,): for each sketched object the index of the map object that it stands for.
    """

    scene: Scene
    partners: IntArray


def random_scene(rng: np.random.Generator, objects: int) -> Scene:
    """Return a scene of random hexagons that lie apart.

    Parameters
    ----------
    rng
        Source of randomness.
    objects
        How many, 2 or more. They lie in random cells, 4 m wide, of a square grid of 16 cells or
        as many as it takes.
    """
    side = max(4, math.isqrt(objects - 1) + 1)
    outlines = []
    for place in rng.permutation(side * side)[:objects]:
        angles = 2 * np.pi * (np.arange(6) + rng.uniform(0.0, 0.45, 6)) / 6
        outline = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        outline *= rng.uniform(0.4, 1.2, (6, 1))
        corner = np.array([4.0 * (place % side), 4.0 * (place // side)])
        outlines.append(outline + corner + rng.uniform(0.0, 1.5, 2))
    return Scene.from_polygons(outlines)


def spacing(scene: Scene) -> float:
    """Return the median distance from an object's centroid to its nearest neighbour's."""
    centres = np.array([item.centroid for item in scene.objects])
    distances = np.hypot(*(centres[:, None] - centres[None, :]).transpose(2, 0, 1))
    np.fill_diagonal(distances, np.inf)
    return float(np.median(distances.min(axis=1)))


def simulate_sketch(
    scene: Scene,
    rng: np.random.Generator,
    *,
    objects: Sequence[int] | None = None,
    rotation: float | None = None,
    scale: float | None = None,
    displacement: float = 0.1,
    turn: float = 0.1,
    stretch: float = 0.1,
    wobble: float = 0.05,
) -> SimulatedSketch:
    """Draw a scene as a person might.

    Parameters
    ----------
    scene
        What is drawn.
    rng
        Source of randomness.
    objects
        Indices of the objects that are drawn; all when left out. They are shuffled.
    rotation, scale
        Of the whole, in radians and as a factor; random when left out (any angle, 1/3 … 3).
    displacement
        Standard deviation of each object's shift, as a share of the objects' median spacing.
    turn, stretch
        Standard deviations of each object's own turn, in radians, and of the logarithm of its
        own scale along x and y.
    wobble
        Standard deviation of the outline's wobble as a share of the object's size.

    Returns
    -------
    SimulatedSketch
        Every polygon in it is valid.
    """
    chosen = rng.permutation(np.arange(len(scene)) if objects is None else np.asarray(objects))
    rotation = rng.uniform(0.0, 2.0 * np.pi) if rotation is None else rotation
    scale = float(np.exp(rng.uniform(-np.log(3.0), np.log(3.0)))) if scale is None else scale
    unit = spacing(scene)
    drawn = []
    for index in chosen:
        item = scene.objects[index]
        shift = rng.normal(0.0, displacement * unit, 2)
        own = _turning(rng.normal(0.0, turn)) * np.exp(rng.normal(0.0, stretch, 2))
        item = _wobbled(item, rng, own, shift, wobble)
        rings = [scale * ring @ _turning(rotation).T for ring in item.rings]
        drawn.append(SceneObject.from_rings(rings, item.label))
    return SimulatedSketch(Scene(tuple(drawn)), chosen.astype(np.int64))


def _wobbled(
    item: SceneObject,
    rng: np.random.Generator,
    own: FloatArray,
    shift: FloatArray,
    wobble: float,
) -> SceneObject:
    """Return the object with a wobbling outline, wobbling less where it would cross itself."""
    centre = np.array(item.centroid)
    size = float(np.sqrt(item.area))
    waves = rng.normal(0.0, wobble * size / 2.0, (2, 4, 2))
    while True:
        rings = []
        for ring in item.rings:
            fine = _resampled(ring, max(4, 2 * len(ring)))
            angle = np.arctan2(*(fine - centre).T[::-1])
            offset = sum(
                np.outer(np.cos(k * angle), waves[0, k - 1])
                + np.outer(np.sin(k * angle), waves[1, k - 1])
                for k in range(1, 5)
            )
            rings.append((fine - centre + offset) @ own.T + centre + shift)
        try:
            return SceneObject.from_rings(rings, item.label)
        except InvalidInputError:
            waves /= 2.0


def _resampled(ring: FloatArray, count: int) -> FloatArray:
    """Return the ring's corners with points put evenly between them, about ``count`` in all."""
    closed = np.vstack([ring, ring[:1]])
    lengths = np.hypot(*np.diff(closed, axis=0).T)
    parts = np.maximum(1, np.rint(count * lengths / lengths.sum())).astype(int)
    return np.vstack(
        [
            closed[k]
            + np.linspace(0.0, 1.0, n, endpoint=False)[:, None] * (closed[k + 1] - closed[k])
            for k, n in enumerate(parts)
        ]
    )


def _turning(angle: float) -> FloatArray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])
