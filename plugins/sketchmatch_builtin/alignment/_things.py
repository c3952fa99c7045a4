"""What alignment knows of objects: where they lie, how large they are, and how elongated."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from sketchmatch.model import FloatArray, Scene, SceneObject
from sketchmatch.model.arrays import ComplexArray

__all__ = ["Things", "things_of"]

_LEAST_SPACING = 1e-9


class Things(NamedTuple):
    """The objects of a scene.

    Attributes
    ----------
    places
        complex, shape (n,): x + iy of the centroids, from the mean of them all.
    sizes
        Shape (n,): ln of the areas.
    shapes
        complex, shape (n,): ½ ln(λ₁/λ₂)·e^{2iφ}, where λ₁ ≥ λ₂ are the second moments along the
        principal axes and φ is the direction of the first. 0 for a square or a circle.
    spacing
        Mean distance from a centroid to the nearest other one.
    """

    places: ComplexArray
    sizes: FloatArray
    shapes: ComplexArray
    spacing: float


@lru_cache(maxsize=32)
def things_of(scene: Scene) -> Things:
    """Return what alignment knows of the objects of a scene."""
    moments = np.array([_moments(item) for item in scene.objects])
    area, x, y, xx, xy, yy = moments.T
    places = x + 1j * y
    distances = np.abs(places[:, None] - places)
    np.fill_diagonal(distances, np.inf)
    extent = float(np.abs(places - places.mean()).max())
    nearest = np.maximum(distances.min(axis=1), _LEAST_SPACING * max(extent, np.sqrt(area.max())))
    half_trace = 0.5 * (xx + yy)
    turned = 0.5 * (xx - yy) + 1j * xy
    eccentric = np.minimum(np.abs(turned) / half_trace, 1.0 - 1e-9)
    direction = np.divide(
        turned, np.abs(turned), out=np.zeros_like(turned), where=np.abs(turned) > 0.0
    )
    return Things(
        places - places.mean(),
        np.log(area),
        np.arctanh(eccentric) * direction,
        float(nearest.mean()),
    )


@lru_cache(maxsize=1024)
def _moments(item: SceneObject) -> tuple[float, ...]:
    """Return area, centroid, and central second moments by area."""
    area = sx = sy = sxx = sxy = syy = 0.0
    origin = item.rings[0][0]
    for ring in item.rings:
        x, y = (ring - origin).T
        u, v = np.roll(x, -1), np.roll(y, -1)
        cross = x * v - u * y
        area += math.fsum(cross) / 2.0
        sx += float(cross @ (x + u)) / 6.0
        sy += float(cross @ (y + v)) / 6.0
        sxx += float(cross @ (x * x + x * u + u * u)) / 12.0
        syy += float(cross @ (y * y + y * v + v * v)) / 12.0
        sxy += float(cross @ (x * v + 2.0 * x * y + 2.0 * u * v + u * y)) / 24.0
    mx, my = sx / area, sy / area
    return (
        area,
        mx + float(origin[0]),
        my + float(origin[1]),
        sxx / area - mx * mx,
        sxy / area - mx * my,
        syy / area - my * my,
    )
