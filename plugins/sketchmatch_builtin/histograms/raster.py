"""The histogram of forces of objects made of pixels."""

from __future__ import annotations

from functools import lru_cache, partial

import numpy as np
from pydantic import Field

from sketchmatch.api import HistogramParams, Reason
from sketchmatch.api.forces import (
    about_object,
    exponent_field,
    force_histograms,
    object_name,
    refuse_infinite,
)
from sketchmatch.api.pixels import PixelObject, outlines, pixel_relations, rasterised
from sketchmatch.model import Edges, FloatArray, IntArray, Scene
from sketchmatch_builtin.histograms._forces import ForceHistogram

__all__ = ["RasterForce"]


class RasterForce(ForceHistogram):
    """Histogram of the forces d^−r of objects on a grid, exact for their pixels.

    The scene is laid on a grid of square pixels, and an object becomes the pixels whose centres it
    contains. Forces act between these sets of pixels, not between digital lines, so the pixels are
    the only approximation.

    References
    ----------
    P. Matsakis, L. Wendling, "A new way to represent the relative position between areal
    objects", IEEE TPAMI 21(7), 1999.

    Examples
    --------
    Sides that lie on the grid make it exact: unit squares, 3 apart, on pixels of 4 / 16.

    >>> import numpy as np
    >>> from sketchmatch.model import Scene
    >>> square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    >>> scene = Scene.from_polygons([square, square + [3, 0]])
    >>> params = RasterForce.Params(directions=4, pixels=16)
    >>> RasterForce(params).describe(scene, np.array([[1, 0]])).tolist()
    [[1.0, 0.0, 0.0, 0.0]]
    """

    name = "raster"
    summary = "Histogram of the forces d^-r of objects made of pixels."

    class Params(HistogramParams):
        """The number of directions, the exponent, and the size of the grid."""

        r: float = exponent_field(0.0)
        pixels: int = Field(
            256,
            ge=8,
            le=4096,
            description="Length of the scene's longer side on the grid.",
            json_schema_extra={"unit": "px"},
        )

    params: Params

    @property
    def of_pairs(self) -> bool:
        """Pixels are as large as the bounds of the scene make them."""
        return False

    @property
    def exponent(self) -> float:
        """r."""
        return self.params.r

    def describe(self, scene: Scene, pairs: IntArray) -> FloatArray:
        """Return the histograms of pairs of objects, shape (k, directions).

        Raises
        ------
        InvalidInputError
            If an object has no pixel, or the force between two of them is infinite.
        """
        pixel, objects, edges = _rasterised(scene, self.params.pixels)
        relations = pixel_relations(objects, pairs)
        refuse_infinite(relations, pairs, self.exponent, partial(object_name, scene))
        histograms = force_histograms(edges, pairs, self.directions, self.exponent, relations)
        histograms *= pixel ** (3.0 - self.exponent)
        return histograms


@lru_cache(maxsize=4)
def _rasterised(scene: Scene, pixels: int) -> tuple[float, tuple[PixelObject, ...], Edges]:
    """Return the size of a pixel, the objects as pixels, and their outlines in pixels."""
    x0, y0, x1, y1 = scene.bounds
    pixel = max(x1 - x0, y1 - y0) / pixels
    corner = np.array([x0, y0])
    starts, ends, offsets = scene.edges
    objects = []
    for k in range(len(scene)):
        own = slice(offsets[k], offsets[k + 1])
        found = rasterised((starts[own] - corner) / pixel, (ends[own] - corner) / pixel)
        if not found.mask.any():
            raise about_object(
                Reason.INVALID_PARAMETER,
                object_name(scene, k),
                f"covers no pixel of a grid of {pixels} pixels; raise histogram.pixels or leave "
                "the object out",
            )
        objects.append(found)
    return pixel, tuple(objects), outlines(objects)
