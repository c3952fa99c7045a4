"""What the histograms of forces d^−r have in common."""

from __future__ import annotations

from functools import partial

import numpy as np

from sketchmatch.api import Histogram
from sketchmatch.api.forces import (
    OVERLAPPING,
    force_histograms,
    object_name,
    refuse_infinite,
    relations_matter,
    scene_relations,
)
from sketchmatch.model import FloatArray, IntArray, Scene

__all__ = ["ForceHistogram", "PowerForce"]


class ForceHistogram(Histogram):
    """A histogram of forces, whose kernel two squares compile."""

    @property
    def of_pairs(self) -> bool:
        """The objects are measured from the scene's middle, and nothing else counts."""
        return True

    @classmethod
    def warm_up(cls) -> None:
        """Compile the kernels."""
        square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
        scene = Scene.from_polygons([square, square + np.array([2.0, 0.0])])
        cls().describe(scene, np.array([[0, 1]]))


class PowerForce(ForceHistogram):
    """A histogram of the forces d^−r between polygons."""

    def describe(self, scene: Scene, pairs: IntArray) -> FloatArray:
        """Return the histograms of pairs of objects, shape (k, directions).

        Raises
        ------
        InvalidInputError
            If the force between two of them is infinite.
        """
        relations = np.full(len(pairs), OVERLAPPING, dtype=np.int64)
        if relations_matter(self.exponent):
            relations = scene_relations(scene, pairs)
            refuse_infinite(relations, pairs, self.exponent, partial(object_name, scene))
        return force_histograms(scene.edges, pairs, self.directions, self.exponent, relations)
