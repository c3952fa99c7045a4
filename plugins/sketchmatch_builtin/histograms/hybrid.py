"""The hybrid-force histogram."""

from __future__ import annotations

import numpy as np
import shapely
from pydantic import Field

from sketchmatch.api import HistogramParams
from sketchmatch.api.forces import (
    APART,
    OVERLAPPING,
    hybrid_force_histograms,
    scene_relations,
)
from sketchmatch.model import FloatArray, IntArray, Scene
from sketchmatch_builtin.histograms._forces import ForceHistogram

__all__ = ["HybridForce"]


class HybridForce(ForceHistogram):
    """Exact histogram of hybrid forces (F02) of polygons: constant up to a distance, 1/d² beyond.

    The distance Y is the larger of ``near`` times the diameter of the smaller object and
    ``overlap`` times that of what the two have in common; the diameter of a shape is that of the
    disc of equal area. It is the Y of the program that L. Wendling and P. Matsakis published with
    [1]_, where the two parameters are p0 and p1. Objects further apart than Y have the
    gravitational histogram; others may touch and overlap, since the force never exceeds 1/Y².

    References
    ----------
    .. [1] P. Matsakis, "Relations spatiales structurelles et interprétation d'images", thesis,
       Université Paul Sabatier, Toulouse, 1998.

    Examples
    --------
    Of unit squares 3 apart the gravitational histogram, ln 9/8 in direction 0; up to Y = 4
    diameters the constant one over Y².

    >>> import numpy as np
    >>> from sketchmatch.model import Scene
    >>> square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    >>> scene = Scene.from_polygons([square, square + [3, 0]])
    >>> params = HybridForce.Params(directions=4)
    >>> HybridForce(params).describe(scene, np.array([[1, 0]])).round(4).tolist()
    [[0.1178, 0.0, 0.0, 0.0]]
    >>> params = HybridForce.Params(directions=4, near=4.0)
    >>> constant = HybridForce(params).describe(scene, np.array([[1, 0]]))
    >>> (constant * 4.0**2 * 4.0 / np.pi).round(4).tolist()
    [[1.0, 0.0, 0.0, 0.0]]
    """

    name = "hybrid"
    summary = "Exact histogram of forces that are constant when near, else gravitational (F02)."
    exponent = 2.0

    class Params(HistogramParams):
        """The number of directions, and the two distances."""

        near: float = Field(
            0.01,
            gt=0.0,
            le=1000.0,
            description="Distance up to which the force is constant, in diameters of the smaller "
            "object.",
        )
        overlap: float = Field(
            3.0,
            ge=0.0,
            le=1000.0,
            description="The same in diameters of the overlap, if that is more.",
        )

    params: Params

    def describe(self, scene: Scene, pairs: IntArray) -> FloatArray:
        """Return the histograms of pairs of objects, shape (k, directions)."""
        relations = scene_relations(scene, pairs)
        radii = self._radii(scene, pairs, relations)
        return hybrid_force_histograms(*scene.edges, pairs, self.directions, radii, relations)

    def _radii(self, scene: Scene, pairs: IntArray, relations: IntArray) -> FloatArray:
        """Return Y of each pair, or 0 where all distances exceed it."""
        polygons = np.array([item.polygon for item in scene.objects])
        a, b = polygons[pairs[:, 0]], polygons[pairs[:, 1]]
        shared = np.zeros(len(pairs))
        crossing = relations == OVERLAPPING
        shared[crossing] = shapely.area(shapely.intersection(a[crossing], b[crossing]))
        smaller = np.minimum(shapely.area(a), shapely.area(b))
        radii = np.maximum(
            self.params.near * _diameter(smaller), self.params.overlap * _diameter(shared)
        )
        apart = relations == APART
        far = shapely.distance(a[apart], b[apart]) >= radii[apart]
        radii[np.flatnonzero(apart)[far]] = 0.0
        return radii


def _diameter(area: FloatArray) -> FloatArray:
    """Return the diameter of the disc of an area."""
    diameter: FloatArray = 2.0 * np.sqrt(area / np.pi)
    return diameter
