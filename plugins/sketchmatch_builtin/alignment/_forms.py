"""What outlines are, however they are turned, scaled or stretched: round, square, with a corner.

An object is whitened: moved, turned and stretched until it has unit variance everywhere. What its
points z = x + iy then have in the mean of z³, z²z̄ and z⁴, in size, and of |z|⁴, is the same for
all its affine images [1]_: a box, however long and turned, is told from an ellipse by the third, a
triangle by the first, and whatever has an arm by the second.

References
----------
.. [1] J. Flusser, T. Suk, "Pattern recognition by affine moment invariants", Pattern Recognition
   26, 1993.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from sketchmatch.model import FloatArray, Scene
from sketchmatch.model.arrays import frozen

__all__ = ["form_distances", "forms_of"]

# A rule for means over a triangle, exact up to the fourth power: barycentric points and weights.
# D. Dunavant, "High degree efficient symmetrical Gaussian quadrature rules for the triangle", 1985.
_A, _B = 0.108103018168070, 0.816847572980459
_POINTS = np.array(
    [
        [_A, (1.0 - _A) / 2.0, (1.0 - _A) / 2.0],
        [(1.0 - _A) / 2.0, _A, (1.0 - _A) / 2.0],
        [(1.0 - _A) / 2.0, (1.0 - _A) / 2.0, _A],
        [_B, (1.0 - _B) / 2.0, (1.0 - _B) / 2.0],
        [(1.0 - _B) / 2.0, _B, (1.0 - _B) / 2.0],
        [(1.0 - _B) / 2.0, (1.0 - _B) / 2.0, _B],
    ]
)
_WEIGHTS = np.repeat([0.223381589678011, 0.109951743655322], 3)


@lru_cache(maxsize=32)
def forms_of(scene: Scene) -> FloatArray:
    """Return the forms of objects, shape (n, 4): |E z³|, |E z²z̄|, |E z⁴| and E |z|⁴."""
    rings = [ring for item in scene.objects for ring in item.rings]
    counts = [len(ring) for item in scene.objects for ring in item.rings]
    of_ring = np.repeat(np.arange(len(scene)), [len(item.rings) for item in scene.objects])
    of = np.repeat(of_ring, counts)
    corners = np.concatenate(rings) @ [1.0, 1.0j]
    ends = np.cumsum(counts)
    following = np.arange(1, len(corners) + 1)
    following[ends - 1] = ends - counts
    starts = np.searchsorted(of, np.arange(len(scene)))
    # Signed triangles from each object's first corner to its edges.
    triangles = np.stack([corners[starts][of], corners, corners[following]])
    triangles = triangles - triangles[0]
    areas = (np.conj(triangles[1]) * triangles[2]).imag / 2.0
    shares = areas / np.add.reduceat(areas, starts)[of]
    weights = _WEIGHTS[:, None] * shares

    def means(values: FloatArray) -> FloatArray:
        summed: FloatArray = np.add.reduceat((weights * values).sum(axis=0), starts)
        return summed

    z = _POINTS @ triangles
    z = z - means(z)[of]
    spread, turned = means(np.abs(z) ** 2).real[of], means(z**2)[of]
    # Whitened along the principal axes: λ = ½ (E |z|² ± |E z²|).
    axis = np.sqrt(np.where(turned != 0.0, turned / np.maximum(np.abs(turned), 1e-300), 1.0))
    long = np.sqrt((spread + np.abs(turned)) / 2.0)
    short = np.sqrt(np.maximum((spread - np.abs(turned)) / 2.0, 1e-12 * spread))
    z = z / axis
    z = z.real / long + 1j * z.imag / short
    square = np.abs(z) ** 2
    return frozen(
        np.column_stack(
            [*(np.abs(means(each)) for each in (z**3, z * square, z**4)), means(square**2).real]
        )
    )


def form_distances(drawn: Scene, mapped: Scene) -> FloatArray:
    """Return how far the forms of objects are apart, squared, shape (n, m)."""
    apart = forms_of(drawn)[:, None] - forms_of(mapped)
    distances: FloatArray = (apart**2).sum(axis=2)
    return distances
