"""The shapes that an SVG document shows, and which of these somebody drew."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely

from sketchmatch.io._svg_curves import Subpath, flattened, signed_area
from sketchmatch.io._svg_ink import pen_lines
from sketchmatch.io._svg_style import Colour
from sketchmatch.model import FloatArray

__all__ = [
    "Box",
    "Shape",
    "box_of",
    "is_closed",
    "lines_of",
    "without_heads",
    "without_paper",
    "without_twins",
]

# Paper may leave this share of the page uncovered at each side, and so much of its own box.
_MARGIN, _ROUNDED = 0.01, 0.03
# Things on a ground that is no paper by its size.
_FEW = 3
# An arrowhead is at most so large beside its line, and fills so much of the box around it.
_HEAD, _POINTED = 0.5, 0.6
# A filling of this share of its box, squared, encloses nothing.
_FLAT = 1e-9

Box = tuple[float, float, float, float]
"""Least x and y, largest x and y."""


@dataclass(frozen=True, eq=False)
class Shape:
    """A shape that can be seen.

    Attributes
    ----------
    subpaths
        Its curves in the drawing's coordinates.
    label
        A name for people.
    fill, stroke
        The colours of its filling and its line, None where it has none.
    evenodd
        Whether its filling is by that rule.
    pen
        Whether its filling may be the ink of a pen.
    place
        How a person finds it in the file.
    box
        Around its control points.
    dashed
        Whether nothing of it is seen but a line with gaps.
    width
        Of its line, in the drawing's units; 0 where it has none.
    opaque
        Whether nothing is seen through its filling.
    """

    subpaths: list[Subpath]
    label: str
    fill: Colour | None
    stroke: Colour | None
    evenodd: bool
    pen: bool
    place: str
    box: Box
    dashed: bool = False
    width: float = 0.0
    opaque: bool = False

    @property
    def filled(self) -> bool:
        """Whether it has a filling."""
        return self.fill is not None

    @property
    def bare(self) -> bool:
        """Whether it is a filling without a line."""
        return self.fill is not None and self.stroke is None


def box_of(subpaths: list[Subpath]) -> Box:
    """Return the box around control points; one that meets none, where there are none."""
    if not subpaths:
        return (0.0, 0.0, -1.0, -1.0)
    points = np.concatenate([curve for subpath in subpaths for curve in subpath])
    x0, y0 = points.min(axis=0).tolist()
    x1, y1 = points.max(axis=0).tolist()
    return (x0, y0, x1, y1)


def without_paper(
    shapes: list[Shape], page: Box | None, background: Colour
) -> tuple[list[Shape], list[Shape]]:
    """Return the shapes that are not the paper, and paper that may have been meant as something.

    Paper is a filled rectangle that covers the page, or that all else lies on, and has no line, or
    one in the page's own colour. What has the paper's colour and no line is not seen on it; nor is
    a line in that colour where there is paper in it: a page that says nothing may be dark.
    """
    white, papered = background, False
    boxes = np.array([shape.box for shape in shapes]).reshape(-1, 4)
    lows = np.minimum.accumulate(boxes[::-1, :2])[::-1]
    highs = np.maximum.accumulate(boxes[::-1, 2:])[::-1]
    kept: list[Shape] = []
    ground: list[Shape] = []
    fillings = np.flatnonzero([shape.filled for shape in shapes])
    under = shapely.STRtree(shapely.box(*boxes[fillings].T))
    filled = np.zeros(len(shapes), dtype=bool)  # of those that were kept so far
    for k, shape in enumerate(shapes):
        sheet = shape.bare or (shape.filled and shape.stroke == white)
        sheet = sheet and _rectangular(shape)
        if sheet and page is not None and _covers(shape.box, page, _MARGIN):
            background = shape.fill or ()
            papered = background == white
        elif (
            sheet
            and not (kept or ground)
            and len(shapes) - k > _FEW
            and _covers(shape.box, (*lows[k + 1], *highs[k + 1]))
        ):
            background = shape.fill or ()
            ground = [shape]
        elif (
            not _like_paper(shape, background, papered)
            or filled[fillings[under.query(shapely.box(*shape.box))]].any()
        ):
            kept.append(shape)
            filled[k] = shape.filled
    return kept, ground


def _covers(box: Box, other: Box, margin: float = 0.0) -> bool:
    """Whether a box covers another but for a share of its size at each side."""
    across, down = margin * (other[2] - other[0]), margin * (other[3] - other[1])
    return (
        box[0] <= other[0] + across
        and box[1] <= other[1] + down
        and box[2] >= other[2] - across
        and box[3] >= other[3] - down
    )


def _like_paper(shape: Shape, background: Colour, papered: bool) -> bool:
    """Whether a shape has no colour but the paper's, or, of a page without, no line either."""
    if papered and shape.stroke == background != ():
        return shape.fill in (None, background)
    return (
        shape.bare
        and shape.fill == background != ()
        and any(signed_area(_ends(subpath)) != 0.0 for subpath in shape.subpaths)
    )


def _rectangular(shape: Shape) -> bool:
    """Whether a shape fills its box, but for rounded corners."""
    if len(shape.subpaths) != 1:
        return False
    x0, y0, x1, y1 = shape.box
    share = abs(signed_area(_ends(shape.subpaths[0]))) / max((x1 - x0) * (y1 - y0), 1e-300)
    return 1.0 - _ROUNDED <= share <= 1.0 + _ROUNDED


def is_closed(subpath: Subpath) -> bool:
    """Whether a subpath ends where it begins."""
    return bool((subpath[0][0] == subpath[-1][-1]).all())


def _ends(subpath: Subpath) -> FloatArray:
    return np.array([curve[0] for curve in subpath] + [subpath[-1][-1]])


def without_twins(shapes: list[Shape]) -> list[Shape]:
    """Leave out fillings whose line follows, or went before, as a shape of its own."""
    kept: list[Shape] = []
    for shape in shapes:
        last = kept[-1] if kept else None
        if last is not None and last.bare != shape.bare and _same(last, shape):
            line, other = (shape, last) if last.bare else (last, shape)
            kept[-1] = replace(line, label=line.label or other.label, fill=other.fill)
        else:
            kept.append(shape)
    return kept


def without_heads(shapes: list[Shape]) -> tuple[list[Shape], list[str]]:
    """Leave out arrowheads that are shapes of their own, and where lines are that have two.

    Tools that use no markers draw them after the line, in its colour and upon its end.
    """
    kept: list[Shape] = []
    dimensions = []
    ends: list[FloatArray] = []  # of the last shape, as far as they have no head
    for shape in shapes:
        head = next((k for k, end in enumerate(ends) if _is_head(shape, kept[-1], end)), None)
        if head is None:
            kept.append(shape)
            ends = _free_ends(shape)
            continue
        del ends[head]
        if not ends:
            dimensions.append(kept.pop().place)
    return kept, dimensions


def _free_ends(shape: Shape) -> list[FloatArray]:
    """Return both ends of an open line; none of all else."""
    if shape.filled or len(shape.subpaths) != 1 or is_closed(shape.subpaths[0]):
        return []
    return [shape.subpaths[0][0][0], shape.subpaths[0][-1][-1]]


def _is_head(shape: Shape, line: Shape, end: FloatArray) -> bool:
    """Whether a shape is pointed, in a line's colour, small beside it, and upon its end."""
    if not shape.fill or shape.fill != line.stroke or shape.stroke not in (None, line.stroke):
        return False
    curves = shape.subpaths[0]
    if len(shape.subpaths) != 1 or len(curves) < 2 or any(len(curve) != 2 for curve in curves):
        return False
    x0, y0, x1, y1 = shape.box
    size = max(x1 - x0, y1 - y0)
    within = x0 <= end[0] <= x1 and y0 <= end[1] <= y1
    if not within or size > _HEAD * max(line.box[2] - line.box[0], line.box[3] - line.box[1]):
        return False
    outline = shapely.Polygon(_ends(curves))
    return bool(outline.area <= _POINTED * outline.minimum_rotated_rectangle.area)


def _same(first: Shape, second: Shape) -> bool:
    if first.box != second.box or len(first.subpaths) != len(second.subpaths):
        return False
    return all(
        len(a) == len(b) and all(map(np.array_equal, a, b))
        for a, b in zip(first.subpaths, second.subpaths, strict=True)
    )


def lines_of(shape: Shape, tolerance: float) -> list[FloatArray]:
    """Return the lines that a shape is drawn with, points of shape (k, 2) each."""
    lines = [flattened(subpath, tolerance) for subpath in shape.subpaths]
    if not shape.filled:
        return lines
    x0, y0, x1, y1 = shape.box
    flat = _FLAT * max(x1 - x0, y1 - y0) ** 2
    bounding = [k for k, line in enumerate(lines) if abs(signed_area(line)) > flat]
    for k in bounding:
        if (lines[k][0] != lines[k][-1]).any():
            lines[k] = np.concatenate([lines[k], lines[k][:1]])
    if not (shape.bare or shape.pen):
        return lines
    corners = [len(shape.subpaths[k]) if shape.pen else 0 for k in bounding]
    drawn = pen_lines([lines[k] for k in bounding], corners, shape.evenodd)
    found = dict(zip(bounding, drawn, strict=True))
    return [each for k, line in enumerate(lines) for each in found.get(k, [line])]
