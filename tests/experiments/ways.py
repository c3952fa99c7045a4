"""Ways through rooms, and how the study's people draw them into their sketches.

A way leads from one side of a place to another, between the things there. Who draws it goes by the
things around: each part of the way lies to the drawn things as the true one lies to the things
themselves (moving least squares, with a similarity for each point), the pen trembles, and passes no
drawn thing on another side than the true way does, nor goes through one.

No number of the engine was or will be learned from this: it is what the study measures with.

References
----------
S. Schaefer, T. McPhail, J. Warren, "Image deformation using moving least squares", ACM
Transactions on Graphics 25(3), 2006.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely
from skimage.graph import route_through_array

from sketchmatch.model import FloatArray, IntArray, Scene
from sketchmatch.testing import spacing

__all__ = ["drawn_way", "swept", "true_way"]

_CELLS = 160
_TRIES = 60
_POINTS = 80
_TREMBLE = 0.03
_AHEAD = 1e-9


def true_way(scene: Scene, rng: np.random.Generator) -> FloatArray:
    """Return a way across a place, shape (k, 2), clear of all things in it."""
    clear = 0.05 * spacing(scene)
    x0, y0, x1, y1 = scene.bounds
    low, high = np.array([x0, y0]) - 3.0 * clear, np.array([x1, y1]) + 3.0 * clear
    step = float((high - low).max()) / _CELLS
    counts = np.ceil((high - low) / step).astype(int) + 1
    places = low + step * np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1)
    things = shapely.union_all([item.polygon for item in scene.objects])
    points = shapely.points(places)
    away = shapely.distance(points, things)
    cost = np.where(away < clear, -1.0, 1.0 + 0.2 * (clear / np.maximum(away, 1e-9)) ** 2)
    free = np.argwhere(cost > 0.0)
    while True:
        ends = free[rng.integers(len(free), size=3)]
        if np.hypot(*(ends[0] - ends[2])) < 0.5 * counts.max():
            continue
        try:
            legs = [route_through_array(cost, a, b)[0] for a, b in pairwise(ends)]
        except ValueError:
            continue
        cells = np.array(legs[0] + legs[1][1:])
        way = shapely.LineString(low + step * cells).simplify(step)
        if way.length > 0.5 * (high - low).max():
            along = np.linspace(0.0, 1.0, _POINTS)
            return shapely.get_coordinates(
                shapely.line_interpolate_point(way, along, normalized=True)
            )


def drawn_way(
    way: FloatArray, map_: Scene, sketch: Scene, truth: IntArray, rng: np.random.Generator
) -> FloatArray | None:
    """Return a way as it is drawn into a sketch; None where nobody could draw it.

    ``truth`` has the map's index of each sketched object, or −1.
    """
    there = np.flatnonzero(truth >= 0)
    places = np.array([map_.objects[truth[k]].centroid for k in there])
    goals = np.array([sketch.objects[k].centroid for k in there])
    wanted = np.array([swept(way, place) for place in places])
    things = shapely.union_all([item.polygon for item in sketch.objects])
    shapely.prepare(things)
    gap = 0.02 * spacing(sketch)
    for attempt in range(_TRIES):
        drawn = _moved(way, places, goals)
        waves = _smooth(rng, len(way)) * _TREMBLE * spacing(sketch) * (1.0 - attempt / _TRIES)
        drawn = _pushed(drawn + waves, things, gap)
        turned = np.array([swept(drawn, goal) for goal in goals])
        through = shapely.intersects(things, shapely.LineString(drawn))
        if not through and (np.abs(turned - wanted) < np.pi).all():
            return drawn
    return None


def swept(way: FloatArray, place: FloatArray) -> float:
    """Return by how much a way turns around a place from its beginning to its end, in radians."""
    around = (way[:, 0] - place[0]) + 1j * (way[:, 1] - place[1])
    return float(np.angle(around[1:] / around[:-1]).sum())


def _moved(points: FloatArray, places: FloatArray, goals: FloatArray) -> FloatArray:
    """Move points as moving least squares do."""
    z, w = (each[:, 0] + 1j * each[:, 1] for each in (places, goals))
    x = points[:, 0] + 1j * points[:, 1]
    weights = 1.0 / np.maximum(np.abs(x[:, None] - z[None, :]) ** 2, _AHEAD)
    weights /= weights.sum(axis=1, keepdims=True)
    middles, ends = weights @ z, weights @ w
    away = z[None, :] - middles[:, None]
    turns = (weights * away.conj() * (w[None, :] - ends[:, None])).sum(axis=1)
    turns /= (weights * np.abs(away) ** 2).sum(axis=1)
    found = ends + turns * (x - middles)
    return np.stack([found.real, found.imag], axis=1)


def _pushed(points: FloatArray, things: shapely.Geometry, gap: float) -> FloatArray:
    """Move points out of things, to the nearest place beside them."""
    pushed = points.copy()
    around = shapely.boundary(shapely.buffer(things, gap))
    inside = np.flatnonzero(shapely.distance(shapely.points(points), things) < gap)
    if len(inside):
        lines = shapely.shortest_line(around, shapely.points(points[inside]))
        pushed[inside] = shapely.get_coordinates(lines)[::2]
    return pushed


def _smooth(rng: np.random.Generator, count: int) -> FloatArray:
    t = np.linspace(0.0, 1.0, count)[:, None, None]
    waves = np.arange(1.0, 9.0)[:, None]
    size, phase = rng.normal(0.0, 0.5, (8, 2)), rng.uniform(0.0, 2.0 * np.pi, (8, 2))
    return np.asarray((size * np.sin(2.0 * np.pi * t * waves + phase)).sum(axis=1))
