"""Objects of a picture: shapes or outlines on paper or a board."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Literal

import numpy as np
import shapely
from pydantic import Field

from sketchmatch.api import InvalidInputError, Params, Reason, Segmentation, Segmenter
from sketchmatch.model import FloatArray, Image, Scene, SceneObject
from sketchmatch_builtin.segmenters._border import outer_border
from sketchmatch_builtin.segmenters._image_colours import areas_of_colours
from sketchmatch_builtin.segmenters._image_drawing import Shape
from sketchmatch_builtin.segmenters._image_ink import Ink, find_ink
from sketchmatch_builtin.segmenters._image_shapes import Tracing, closed_beside, trace

__all__ = ["ImageSegmenter"]

_FRAMED = (
    "The line around everything was taken as a frame and left out: set frame to 'keep' if it is "
    "an object."
)


class ImageSegmenter(Segmenter):
    """Takes shapes as objects, filled or outlined, scanned or photographed, dark or light.

    Whether ink is darker or lighter than the paper, as chalk on a board is, is decided by what lies
    along the picture's border and, if both do, by what is rare nearby. The illumination of the
    paper is estimated [1]_ and divided out, and ink is separated from paper halfway between them
    [2]_. Each shape is traced around its outside [3]_, so an outline counts as what it encloses,
    and what lies within an object is ignored. Gaps in outlines are closed; lines that enclose
    nothing, ruled lines and a table around the sheet are left out. Outlines that touch or overlap
    are separated where that gives the fewest convex shapes. One shape around most of the drawing is
    a frame and is left out. Coordinates are pixels from the lower left corner. Objects come in
    reading order: by their highest point from the top down, then from the left.

    Small shapes close to each other in a row are taken as writing if some are open, or if there are
    several such rows.

    References
    ----------
    .. [1] L. Vincent, "Morphological grayscale reconstruction in image analysis", IEEE
       Transactions on Image Processing 2(2), 1993.
    .. [2] J. Bernsen, "Dynamic thresholding of gray-level images", ICPR 1986.
    .. [3] S. Suzuki, K. Abe, "Topological structural analysis of digitized binary images by
       border following", Computer Vision, Graphics, and Image Processing 30(1), 1985.

    Examples
    --------
    A filled box, and the outline of another one, which counts as what it encloses.

    >>> import numpy as np
    >>> from sketchmatch.model import Image
    >>> pixels = np.full((100, 120), 255, np.uint8)
    >>> pixels[20:40, 20:60] = pixels[60:90, 70:100] = 0
    >>> pixels[64:86, 74:96] = 255
    >>> params = ImageSegmenter.Params(blur=0.0)
    >>> scene = ImageSegmenter(params).segment(Image(pixels)).scene
    >>> [item.area for item in scene.objects]
    [800.0, 900.0]
    """

    name = "image"
    summary = "Shapes or outlines on paper or a board, scanned, photographed or drawn to scale."
    default = True
    sources = (Image,)

    class Params(Params):
        """What is noise, what is a frame, and how outlines are closed and smoothed."""

        blur: float = Field(
            1.0,
            ge=0.0,
            le=50.0,
            description=(
                "Standard deviation of the Gaussian blur that reduces noise before the threshold; "
                "0 for none."
            ),
            json_schema_extra={"unit": "px"},
        )
        min_size: float = Field(
            0.02,
            ge=0.0,
            le=1.0,
            description=(
                "Shapes smaller than a square with this side, as a share of the picture's larger "
                "side, are left out."
            ),
        )
        simplify: float = Field(
            0.01,
            ge=0.0,
            le=0.2,
            description="Largest deviation of a simplified outline from the shape, as a share of "
            "its size.",
        )
        ink: Literal["auto", "dark", "light"] = Field(
            "auto",
            description=(
                "Whether the drawing is darker or lighter than its background, as chalk on a "
                "blackboard is; 'auto' decides by the picture."
            ),
        )
        faint: float = Field(
            0.2,
            ge=0.0,
            le=1.0,
            description=(
                "Lines that absorb less light than this share of what the darkest absorb are left "
                "out, such as smudges, erased lines and what shows through the paper."
            ),
        )
        frame: Literal["auto", "keep"] = Field(
            "auto",
            description=(
                "How to treat one shape around at least two others, walls around far smaller "
                "things, and a table around the sheet: 'auto' leaves it out, 'keep' takes it as "
                "one object."
            ),
        )
        max_gap: float = Field(
            0.15,
            ge=0.0,
            le=0.5,
            description=(
                "Widest gap in an outline that is closed, as a share of the outline's size; 0 "
                "closes none."
            ),
        )
        colours: Literal["merge", "separate"] = Field(
            "merge",
            description=(
                "How to treat touching areas filled in different colours or shades: 'merge' makes "
                "them one object, 'separate' makes each its own."
            ),
        )

    params: Params

    def segment(self, source: Image) -> Segmentation:
        """Return the shapes as objects, in pixels from the picture's lower left corner."""
        params, keep = self.params, self.params.frame == "keep"
        ink = find_ink(source.pixels, params.blur, keep, params.ink, params.faint)
        least = (params.min_size * max(ink.mask.shape)) ** 2
        found = trace(ink.mask, least, params.max_gap, not keep)
        fainter = closed_beside(ink.fainter, found.shapes, least)
        if params.colours == "separate":
            found.shapes = areas_of_colours(ink, found.shapes, least)
        rows, columns = source.pixels.shape[:2]
        side = math.ceil(params.min_size * max(rows, columns))
        _check_count(len(found.shapes), fainter, side)
        outlines = sorted(
            (self._simplified(_outline(shape, ink, rows)) for shape in found.shapes),
            key=lambda outline: (-outline[:, 1].max(), outline[:, 0].min()),
        )
        scene = Scene(tuple(SceneObject.from_rings([outline]) for outline in outlines))
        return Segmentation(scene, (*ink.warnings, *_said(found), *_said_of_fainter(fainter)))

    def _simplified(self, outline: FloatArray) -> FloatArray:
        tolerance = self.params.simplify * float(np.ptp(outline, axis=0).max())
        return shapely.get_coordinates(shapely.Polygon(outline).simplify(tolerance))


def _outline(shape: Shape, ink: Ink, rows: int) -> FloatArray:
    """Return the border of a shape in pixels of the picture; row 0 is its highest: y turns up."""
    outline = (outer_border(shape.mask) + shape.corner) * ink.scale
    return np.asarray(np.stack([outline[:, 0], rows - outline[:, 1]], axis=1))


def _said(found: Tracing) -> Iterator[str]:
    if found.framed:
        yield _FRAMED
    if found.rooms:
        yield (
            f"{_count(found.rooms, 'outline')} around other shapes {_was(found.rooms)} taken as "
            "walls of rooms and left out: set frame to 'keep' to have only what encloses others."
        )
    if found.attached:
        yield (
            f"{_count(found.attached, 'shape')} drawn against the frame {_was(found.attached)} "
            f"taken as {'objects' if found.attached > 1 else 'an object'}."
        )
    if found.written:
        yield (
            f"{_count(found.written, 'small shape')} close to each other in rows "
            f"{_was(found.written)} left out, as writing: draw objects apart."
        )
    if found.parted:
        yield (
            f"{_count(found.parted, 'drawing')} of touching or overlapping outlines "
            f"{_was(found.parted)} split into the likely objects: draw objects apart to be sure."
        )
    if found.divided:
        yield (
            f"{_count(found.divided, 'outline')} divided by lines from side to side "
            f"{_was(found.divided)} taken as one object{' each' * (found.divided > 1)}: leave a "
            "gap between objects that share a side."
        )
    if found.closed:
        yield (
            f"{_count(found.closed, 'outline')} with gaps {_was(found.closed)} closed: lower "
            f"max_gap if {'it is not an object' if found.closed == 1 else 'they are not objects'}."
        )
    if found.open_lines:
        yield (
            f"{_count(found.open_lines, 'line')} that enclose{'s' * (found.open_lines == 1)} "
            f"nothing {_was(found.open_lines)} left out: close an outline, or raise max_gap, to "
            "have an object."
        )


def _said_of_fainter(number: int) -> Iterator[str]:
    if number:
        yield (
            f"{_count(number, 'shape')} far fainter than the darkest {_was(number)} left out: "
            f"draw with one pen, or lower faint, to have {'it' if number == 1 else 'them'}."
        )


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' * (number != 1)}"


def _was(number: int) -> str:
    return "was" if number == 1 else "were"


def _check_count(found: int, fainter: int, side: int) -> None:
    if found < 2:
        remedy = "draw objects apart from each other, lower min_size, or choose the segmenter "
        remedy += "rooms if it is a floor plan"
        if fainter:
            remedy = f"{_count(fainter, 'other')} {_was(fainter)} left out as far fainter than the "
            remedy += "darkest: draw with one pen, or lower faint"
        raise InvalidInputError(
            Reason.TOO_FEW_OBJECTS,
            "pixels",
            f"has {'no shape' if not found else 'only one shape'} of at least {side} "
            f"pixels' side, and a match needs two; {remedy}",
        )
