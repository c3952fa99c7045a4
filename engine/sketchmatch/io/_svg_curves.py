"""The geometry of SVG shapes: Bézier curves in the drawing's coordinates, and points along them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator
from typing import Any
from xml.etree import ElementTree

import numpy as np
import svgelements

from sketchmatch.errors import InvalidInputError
from sketchmatch.io._svg_frame import NUMBER, Frame, length
from sketchmatch.io._svg_style import Look
from sketchmatch.io._svg_tree import invalid, named_element, tag_of
from sketchmatch.model import FloatArray

__all__ = [
    "LISTS",
    "SHAPES",
    "TOLERANCE",
    "Subpath",
    "flattened",
    "signed_area",
    "size_of",
    "steps_of",
    "subpaths_of",
]

Subpath = list[FloatArray]
"""Curves that follow each other, each as its control points, shape (2…4, 2)."""

SHAPES = {
    "path": svgelements.Path,
    "line": svgelements.SimpleLine,
    "polyline": svgelements.Polyline,
    "polygon": svgelements.Polygon,
    "rect": svgelements.Rect,
    "circle": svgelements.Circle,
    "ellipse": svgelements.Ellipse,
}
TOLERANCE = 1e-3
"""Largest distance between a curve and its stroke, as a share of the drawing's larger side."""
# Beyond this, coordinates are a broken file's, and their squares would soon overflow.
_LARGEST = 1e15

_EXTENT = {"rect": ("width", "height"), "circle": ("r",), "ellipse": ("rx", "ry")}
# What percentages are shares of.
_ALONG: dict[str, Callable[[Frame], float]] = {
    **dict.fromkeys(("x", "x1", "x2", "width", "cx", "rx"), lambda frame: frame.width),
    **dict.fromkeys(("y", "y1", "y2", "height", "cy", "ry"), lambda frame: frame.height),
    "r": lambda frame: math.hypot(frame.width, frame.height) / math.sqrt(2.0),
}
LISTS = {"d", "points"}
"""Attributes that are lists of vertices."""
_NUMBER = re.compile(NUMBER, re.IGNORECASE)
_CSS_PATH = re.compile(r"""path\(\s*(?:(?:nonzero|evenodd)\s*,\s*)?(["'])(.*)\1\s*\)""", re.DOTALL)


def subpaths_of(
    element: ElementTree.Element,
    look: Look,
    frame: Frame | None,
    matrix: Any,
    field: str,
    line: int,
) -> list[Subpath]:
    """Return the subpaths of a shape.

    Parameters
    ----------
    element
        The shape.
    look
        How it is shown.
    frame
        The viewport that percentages are shares of.
    matrix
        From the shape's coordinates to the drawing's.
    field, line
        Where it is in the document.

    Raises
    ------
    InvalidInputError
        If it cannot be read.
    """
    geometry = _geometry(element, look, frame, field, line)
    try:
        shape = SHAPES[tag_of(element)](geometry)
        segments = [*_placed(shape.segments(transformed=False), matrix)]
        points = np.array([p for _, part in segments for p in part], np.float64).reshape(-1, 2)
    except (ValueError, TypeError, IndexError, ArithmeticError, AttributeError):
        raise _unreadable(element, field, "a shape that cannot be read", line) from None
    if str(geometry.get("d", "")).strip() and not segments:
        raise _unreadable(element, field, "path data that cannot be read", line)
    if not (np.abs(points) < _LARGEST).all():
        raise _unreadable(element, field, "a coordinate that is not a usable number", line)
    subpaths: list[Subpath] = []
    ended, first = True, 0
    for kind, part in segments:
        controls = points[first : first + len(part)]
        first += len(part)
        if kind is svgelements.Move:
            ended = True
            continue
        if ended:
            subpaths.append([])
        ended = kind is svgelements.Close
        subpaths[-1].append(controls)
    return subpaths


def _placed(
    segments: Iterable[Any], matrix: Any
) -> Iterator[tuple[type, list[tuple[float, float]]]]:
    """Yield the segments of a path: their kinds, and their control points in the drawing."""
    a, b, c, d, e, f = matrix.a, matrix.b, matrix.c, matrix.d, matrix.e, matrix.f
    for segment in segments:
        if isinstance(segment, svgelements.Arc):
            for curve in (segment * matrix).as_cubic_curves():
                yield type(curve), [(p.x, p.y) for p in curve]
        else:
            points = [p for p in segment if p is not None]
            yield (
                type(segment),
                [(p.x * a + p.y * c + e, p.x * b + p.y * d + f) for p in points],
            )


def _geometry(
    element: ElementTree.Element, look: Look, frame: Frame | None, field: str, line: int
) -> dict[str, Any]:
    """Return what says where a shape is; what has no extent is not drawn."""
    said = look.geometry
    extent = _EXTENT.get(tag_of(element), ())
    geometry: dict[str, Any] = dict.fromkeys(extent, 0.0)
    for name, text in (*element.items(), *said.items()):
        if name in LISTS:
            path = _CSS_PATH.fullmatch(text) if name in said else None
            geometry[name] = path[2] if path else text
            if name == "points":  # read here: of a number of many digits others never come back
                geometry[name] = [float(each) for each in _NUMBER.findall(text)]
        elif name in _ALONG and text.strip() != "auto":
            try:
                value = length(text, _ALONG[name](frame) if frame else None, look.font_size)
            except ValueError:
                problem, remedy = f"{name}={text[:40]!r}, which is not a length", "write it in px"
                if text.rstrip().endswith("%"):
                    problem = f"{name}={text[:40]!r} of a page without a size"
                    remedy = "give <svg> a viewBox"
                raise _unreadable(element, field, problem, line, remedy) from None
            geometry[name] = max(0.0, value) if name in extent else value
    if tag_of(element) == "ellipse":
        told = {*element.keys(), *said}
        if not {"rx", "ry"} <= told:
            geometry["rx"] = geometry["ry"] = geometry["rx"] or geometry["ry"]
    return geometry


def size_of(curves: list[FloatArray]) -> float:
    """Return the larger side of a box around curves."""
    return float(np.ptp(np.concatenate(curves), axis=0).max())


def signed_area(points: FloatArray) -> float:
    """Return the area in a line that is closed, or will be, counter-clockwise positive.

    What it goes around twice counts twice.
    """
    x, y = (points - points[0]).T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def flattened(curves: Subpath, tolerance: float) -> FloatArray:
    """Return points along curves that follow each other, shape (k, 2)."""
    points = [curves[0][:1]]
    points += [_samples(controls, tolerance)[1:] for controls in curves]
    return np.concatenate(points)


def _samples(controls: FloatArray, tolerance: float) -> FloatArray:
    """Return points along a Bézier curve, no farther from it than the tolerance."""
    steps = steps_of(controls, tolerance)
    if steps == 1:
        return controls[[0, -1]]
    t = np.linspace(0.0, 1.0, steps + 1)[:, None, None]
    level = np.broadcast_to(controls, (steps + 1, *controls.shape))
    while level.shape[1] > 1:
        level = (1.0 - t) * level[:, :-1] + t * level[:, 1:]
    return level[:, 0]


def steps_of(controls: FloatArray, tolerance: float) -> int:
    """Return into how many chords of equal steps a Bézier curve is cut.

    A curve of degree d leaves the chords of n equal steps by at most d(d−1)/8n² times the
    largest second difference of its control points.
    """
    degree = len(controls) - 1
    if degree < 2 or tolerance <= 0.0:
        return 1
    bend = float(np.hypot(*np.diff(controls, 2, axis=0).T).max())
    return max(1, math.ceil(math.sqrt(degree * (degree - 1) / 8.0 * bend / tolerance)))


def _unreadable(
    element: ElementTree.Element,
    field: str,
    problem: str,
    line: int,
    remedy: str = "draw it again",
) -> InvalidInputError:
    return invalid(
        field,
        f"({named_element(element)}) has {problem}, on line {line} of the file; {remedy}",
    )
