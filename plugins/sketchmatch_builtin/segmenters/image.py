"""Objects of a picture: dark shapes or outlines on light paper."""

from __future__ import annotations

import math
from typing import Any, Literal

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field

from sketchmatch.api import InvalidInputError, Params, Reason, Segmentation, Segmenter
from sketchmatch.model import FloatArray, Image, Scene, SceneObject
from sketchmatch_builtin.segmenters._border import outer_border

__all__ = ["ImageSegmenter"]

_Mask = NDArray[np.uint8]

# Grey levels between the darkest and the lightest spot, after smoothing, that paper alone reaches.
_PAPER_CONTRAST = 32
_MOST_OBJECTS = 1000

_INVERTED = "The picture is light on dark: it was read as its negative."
_FRAMED = (
    "The line around everything was taken as a frame and left out: set frame to 'keep' if it is "
    "an object."
)


class ImageSegmenter(Segmenter):
    """Takes dark shapes as objects, filled or drawn in outline.

    Otsu's threshold [1]_ parts ink from paper; each shape is then traced around its outside [2]_,
    so that an outline counts as what it encloses, and nothing within an object is looked at. One
    shape around at least two others is a frame and left out. Coordinates are pixels from the
    lower left corner. Objects come in reading order: by their highest point from the top down,
    then from the left.

    References
    ----------
    .. [1] N. Otsu, "A threshold selection method from gray-level histograms", IEEE Transactions
       on Systems, Man, and Cybernetics 9(1), 1979.
    .. [2] S. Suzuki, K. Abe, "Topological structural analysis of digitized binary images by
       border following", Computer Vision, Graphics, and Image Processing 30(1), 1985.
    """

    name = "image"
    summary = "Dark shapes or outlines on light paper."
    sources = (Image,)

    class Params(Params):
        """What is noise, what is a frame, and how outlines are smoothed."""

        blur: float = Field(
            1.0,
            ge=0.0,
            le=50.0,
            description=(
                "Standard deviation of the Gaussian that evens out noise before the threshold, "
                "in pixels; 0 for none."
            ),
        )
        min_size: float = Field(
            0.02,
            ge=0.0,
            le=1.0,
            description=(
                "Shapes smaller than a square with this side are left out, as a share of the "
                "picture's larger side."
            ),
        )
        simplify: float = Field(
            0.01,
            ge=0.0,
            le=0.2,
            description="How far a simplified outline may leave the shape, as a share of its size.",
        )
        frame: Literal["auto", "keep"] = Field(
            "auto",
            description=(
                "What to do with one shape around at least two others: 'auto' leaves it out as a "
                "frame, 'keep' takes it as the one object it is."
            ),
        )

    params: Params

    def segment(self, source: Image) -> Segmentation:
        """Return the shapes as objects, in pixels from the picture's lower left corner."""
        ink, inverted = _ink(source.pixels, self.params.blur)
        side = self.params.min_size * max(ink.shape)
        # Row 0 of a picture is its highest: here, once, y turns up.
        drawing = _Drawing(ink[::-1], side * side)
        shapes = drawing.outermost()
        framed = False
        if self.params.frame == "auto" and len(shapes) == 1:
            inside = drawing.inside(shapes[0])
            framed = len(inside) >= 2
            shapes = inside if framed else shapes
        _check_count(len(shapes), side)
        outlines = sorted(
            (self._simplified(drawing.outline(shape)) for shape in shapes),
            key=lambda outline: (-outline[:, 1].max(), outline[:, 0].min()),
        )
        scene = Scene(tuple(SceneObject.from_rings([outline]) for outline in outlines))
        said = ((_INVERTED, inverted), (_FRAMED, framed))
        return Segmentation(scene, tuple(warning for warning, true in said if true))

    def _simplified(self, outline: FloatArray) -> FloatArray:
        tolerance = self.params.simplify * float(np.ptp(outline, axis=0).max())
        return shapely.get_coordinates(shapely.Polygon(outline).simplify(tolerance))


class _Drawing:
    """The shapes of a picture, and which lies in which; a shape is the index of its contour."""

    def __init__(self, ink: _Mask, least: float) -> None:
        self._contours, hierarchy = cv2.findContours(ink, cv2.RETR_TREE, cv2.CHAIN_APPROX_NONE)
        self._parents = np.zeros(0, np.int64) if hierarchy is None else hierarchy[0][:, 3]
        # Pick's theorem: the pixels within a contour, from its area between pixel centres.
        pixels = [cv2.contourArea(c) + len(c) / 2.0 + 1.0 for c in self._contours]
        self._large = np.array(pixels) >= least

    def outermost(self) -> list[int]:
        """Return the large shapes that lie in no other."""
        return self._children([-1])

    def inside(self, shape: int) -> list[int]:
        """Return the large shapes that lie in the holes of a shape."""
        return self._children(np.flatnonzero(self._parents == shape))

    def outline(self, shape: int) -> FloatArray:
        """Return the border of a shape and all that it encloses, in pixels, shape (k, 2)."""
        x, y, width, height = cv2.boundingRect(self._contours[shape])
        mask = np.zeros((height, width), np.uint8)
        cv2.drawContours(mask, self._contours, shape, 1, cv2.FILLED, offset=(-x, -y))
        return np.add(outer_border(mask), (x, y), dtype=np.float64)

    def _children(self, parents: Any) -> list[int]:
        return [int(k) for k in np.flatnonzero(np.isin(self._parents, parents) & self._large)]


def _ink(pixels: NDArray[np.uint8], blur: float) -> tuple[_Mask, bool]:
    """Return where the ink is, and whether it is the lighter of the two."""
    grey = cv2.GaussianBlur(pixels, (0, 0), blur) if blur > 0.0 else pixels
    contrast = int(grey.max()) - int(grey.min())
    if contrast < _PAPER_CONTRAST:
        raise InvalidInputError(
            Reason.INVALID_IMAGE,
            "pixels",
            f"is blank: lightest and darkest differ by {contrast} of 255 grey levels; give a "
            "picture with dark shapes on light paper",
        )
    _, below = cv2.threshold(grey, 0, 1, cv2.THRESH_BINARY_INV | cv2.THRESH_OTSU)
    dark = np.asarray(below, dtype=np.uint8)
    border = np.concatenate([dark[0], dark[-1], dark[:, 0], dark[:, -1]])
    inverted = bool(border.mean() > 0.5)
    return (1 - dark if inverted else dark), inverted


def _check_count(found: int, side: float) -> None:
    if found > _MOST_OBJECTS:
        raise InvalidInputError(
            Reason.LIMIT_EXCEEDED,
            "pixels",
            f"has {found} shapes, more than the limit of {_MOST_OBJECTS}; raise blur or min_size",
        )
    if found < 2:
        raise InvalidInputError(
            Reason.TOO_FEW_OBJECTS,
            "pixels",
            f"has {'no shape' if not found else 'only one shape'} of at least {math.ceil(side)} "
            "pixels' side, and a match needs two; draw objects apart from each other, or lower "
            "min_size",
        )
