"""The constant-force histogram."""

from __future__ import annotations

import numpy as np

from sketchmatch.api import Histogram
from sketchmatch.api.kernels import constant_force_histograms
from sketchmatch.model import FloatArray, IntArray, Scene

__all__ = ["ConstantForce"]


class ConstantForce(Histogram):
    """Exact histogram of constant forces, r = 0, of polygons with holes, overlap allowed.

    Source: P. Matsakis, L. Wendling, "A new way to represent the relative position between areal
    objects", IEEE TPAMI 21(7), 1999; thesis, section 3.1.
    """

    name = "constant"
    summary = "Exact constant-force histogram (r = 0) of polygons."
    exponent = 0.0

    @classmethod
    def warm_up(cls) -> None:
        """Compile the kernel."""
        square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
        cls().describe(Scene.from_polygons([square, square]), np.array([[0, 1]]))

    def describe(self, scene: Scene, pairs: IntArray) -> FloatArray:
        """Return the histograms of pairs of objects, shape (k, directions)."""
        rings = [[np.asarray(ring) for ring in item.rings] for item in scene.objects]
        starts = np.concatenate([ring for item in rings for ring in item])
        ends = np.concatenate([np.roll(ring, -1, axis=0) for item in rings for ring in item])
        counts = [sum(len(ring) for ring in item) for item in rings]
        offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        return constant_force_histograms(starts, ends, offsets, pairs, self.params.directions)
