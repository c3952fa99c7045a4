"""Objects of many polygons: each as ``SceneObject.from_rings`` makes it, all of them at once."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from sketchmatch.errors import InvalidInputError
from sketchmatch.model.arrays import ComplexArray, FloatArray, IntArray, sealed
from sketchmatch.model.scene import FARTHEST, FLAT, SceneObject
from sketchmatch.model.sources import LabelledPolygon

__all__ = ["objects_of"]


def objects_of(polygons: Sequence[LabelledPolygon]) -> tuple[SceneObject, ...]:
    """Turn polygons into objects, sooner than one after the other.

    Raises
    ------
    InvalidInputError
        As :meth:`SceneObject.from_rings` does for the first one that cannot be used, with a path
        that begins with ``polygons[k]``.
    """
    with suppress(InvalidInputError):
        if (found := _at_once(polygons)) is not None:
            return found
    return tuple(_object(polygon, k) for k, polygon in enumerate(polygons))


def _object(polygon: LabelledPolygon, k: int) -> SceneObject:
    try:
        return SceneObject.from_rings(polygon.rings, polygon.label, polygon.certainty)
    except InvalidInputError as error:
        raise error.within(f"polygons[{k}]") from None


def _at_once(polygons: Sequence[LabelledPolygon]) -> tuple[SceneObject, ...] | None:
    """Turn polygons into objects; None where anything is wrong, which is not told here."""
    counts = [len(polygon.rings) for polygon in polygons]
    rings = _rings(polygons)
    if not rings or not all(counts):
        return None
    points, sizes = np.concatenate(rings), np.array(list(map(len, rings)))
    ends = sizes.cumsum()
    firsts = ends - sizes
    low, high = np.minimum.reduceat(points, firsts), np.maximum.reduceat(points, firsts)
    if not max(high.max(), -low.min()) <= FARTHEST:  # nor nan
        return None
    before = np.arange(-1, len(points) - 1)
    before[firsts] = ends - 1
    z = points.view(np.complex128)[:, 0]  # x + iy: half as many steps
    distinct = z != z[before]
    if not distinct.all():
        sizes = np.add.reduceat(distinct, firsts, dtype=np.int64)
        if sizes.min() < 3:
            return None
        z, ends = z[distinct], sizes.cumsum()
        firsts = ends - sizes
    areas = _signed_areas(z, firsts, ends)
    outer = [0, *itertools.accumulate(counts[:-1])]
    extent = (high - low).max(axis=1)[outer]
    least = FLAT * extent * extent
    flat = np.abs(areas[outer]) <= least
    backwards = areas > 0.0
    backwards[outer] ^= True
    if backwards.any():
        mirrored = (firsts + ends - 1).repeat(sizes) - np.arange(len(z))
        z = np.where(backwards.repeat(sizes), z[mirrored], z)
        areas = _signed_areas(z, firsts, ends)
    points = sealed(z.view(np.float64).reshape(-1, 2))
    shapes = _shapes(points, sizes, counts)
    if (flat | ~shapely.is_valid(shapes) | (shapely.area(shapes) <= least)).any():
        return None
    kept = [points[a:b] for a, b in zip(firsts.tolist(), ends.tolist(), strict=True)]
    parts = (
        polygons,
        itertools.pairwise([*outer, len(rings)]),
        shapes.tolist(),
        shapely.get_coordinates(shapely.centroid(shapes)).tolist(),
    )
    objects, known = [], areas.tolist()
    for polygon, (a, b), shape, (x, y) in zip(*parts, strict=True):
        made = SceneObject(tuple(kept[a:b]), polygon.label, polygon.certainty)
        # What its properties would compute, to the last digit.
        vars(made).update(polygon=shape, area=float(sum(known[a:b])), centroid=(x, y))
        objects.append(made)
    return tuple(objects)


def _rings(polygons: Sequence[LabelledPolygon]) -> list[FloatArray]:
    """Return the rings of polygons as arrays; none where one of them is no ring."""
    try:
        rings = [np.asarray(ring, np.float64, "C") for each in polygons for ring in each.rings]
    except (TypeError, ValueError):
        return []
    shaped = all(ring.ndim == 2 and ring.shape[1] == 2 and len(ring) > 2 for ring in rings)
    return rings if shaped else []


def _shapes(points: FloatArray, sizes: IntArray, counts: list[int]) -> NDArray[np.object_]:
    """Return polygons of shapely: of so many rings each, which are of so many points each."""
    lines: Any = shapely.linearrings(points, indices=np.arange(len(sizes)).repeat(sizes))
    if len(sizes) == len(counts):
        return np.asarray(shapely.polygons(lines))
    return np.asarray(shapely.polygons(lines, indices=np.arange(len(counts)).repeat(counts)))


def _signed_areas(z: ComplexArray, firsts: IntArray, ends: IntArray) -> FloatArray:
    """Return what :func:`sketchmatch.model.scene.signed_area` does for each of some rings."""
    after = np.arange(1, len(z) + 1)
    after[ends - 1] = firsts
    around = z - z[firsts].repeat(ends - firsts)
    beyond = around[after]
    x, y, u, v = around.real, around.imag, beyond.real, beyond.imag
    spans = map(slice, firsts.tolist(), ends.tolist())
    return np.array([np.dot(x[k], v[k]) - np.dot(y[k], u[k]) for k in spans]) / 2.0
