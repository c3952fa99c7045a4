"""Strokes from an SVG drawing, as vector tools and sketch pads export it.

Every ``path``, ``line``, ``polyline``, ``polygon``, ``rect``, ``circle`` and ``ellipse`` becomes a
stroke, every further subpath one more, with all transforms applied and y turned up; a closed
shape repeats its first point. ``use`` is followed within the document; text, pictures and what is
not displayed are ignored. Coordinates are user units: ``viewBox`` scales a drawing as a whole,
which a match does not see.

A shape's label is the first that it has of: its ``<title>``, ``aria-label``, ``inkscape:label``,
and an ``id`` that a person gave (``desk-2``, but not a tool's ``path123``); or else that of the
innermost group with a title or one of these two labels which is no layer.

Paper is no shape: a rectangle without a stroke that covers the whole drawing is ignored. Of the
paths with which Excalidraw draws one shape, its hatching or filling first, the last is taken: the
outline, every line of which is drawn twice.

Nothing outside the document is ever opened, and a document that defines entities is refused.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np
import svgelements

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import FloatArray, Stroke, StrokeSet
from sketchmatch.model.limits import check_vertices, source_limits

__all__ = ["decode_svg"]

_MAX_DEPTH = 200
_LONGEST_CAUSE = 100
# Largest distance between a curve and its stroke, as a share of the drawing's larger side.
_TOLERANCE = 1e-3
# Beyond this, coordinates are a broken file's, and their squares would soon overflow.
_LARGEST = 1e15

_SHAPES = {
    "path": svgelements.Path,
    "line": svgelements.SimpleLine,
    "polyline": svgelements.Polyline,
    "polygon": svgelements.Polygon,
    "rect": svgelements.Rect,
    "circle": svgelements.Circle,
    "ellipse": svgelements.Ellipse,
}
_EXTENT = {"rect": ("width", "height"), "circle": ("r",), "ellipse": ("rx", "ry")}
_LENGTHS = {"x", "y", "x1", "y1", "x2", "y2", "width", "height", "cx", "cy", "r", "rx", "ry"}
_LISTS = {"d", "points"}
_LENGTH = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)(px|pt|pc|mm|cm|in|)\s*", re.I)
_UNITS = {"": 1.0, "px": 1.0, "pt": 4 / 3, "pc": 16.0, "mm": 96 / 25.4, "cm": 96 / 2.54, "in": 96.0}
_DRAWN = {*_SHAPES, "svg", "g", "a", "switch", "use"}
_HREFS = ("href", "{http://www.w3.org/1999/xlink}href")
_INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"
_EXCALIDRAW = b"svg-source:excalidraw"
_COMMAND = re.compile(r"([MLHVCSQTAZ])([^MLHVCSQTAZ]*)", re.IGNORECASE)
_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?", re.IGNORECASE)
_ARITY = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 1}
_TOOLS_ID = re.compile(
    r"(path|line|polyline|polygon|rect|circle|ellipse|use|g|svg|svgid|xmlid|shape|stroke|object"
    r"|vector|element|layer)?[\W\d_]*",
    re.IGNORECASE,
)
_HIDDEN = re.compile(r"(^|;)\s*display\s*:\s*none\b")
_STROKED = re.compile(r"(^|;)\s*stroke\s*:\s*(?!none\b)")


def decode_svg(data: bytes) -> StrokeSet:
    """Decode the shapes of an SVG document as strokes, in the order they are drawn.

    Parameters
    ----------
    data
        The document, in any encoding that it declares.

    Raises
    ------
    InvalidInputError
        If it is not SVG, defines entities, is too large or nested too deeply, has nothing drawn
        in it, or a shape cannot be read; then its path is ``shapes[k]``, counted from 0. What is
        too large :func:`sketchmatch.model.limits.source_limits` says.

    Examples
    --------
    >>> sketch = decode_svg(b'<svg><g transform="translate(5)"><path d="M0 1h2v1z"/></g></svg>')
    >>> sketch.strokes[0].points.tolist()
    [[5.0, -1.0], [7.0, -1.0], [7.0, -2.0], [5.0, -1.0]]
    """
    root = _document(data)
    if _tag(root) != "svg":
        raise _invalid(
            "", f"is XML but no SVG: it begins with <{_tag(root)[:_LONGEST_CAUSE]}>; save it as SVG"
        )
    drawn = [
        (subpath, label)
        for k, (element, matrix, label) in enumerate(_drawn(root, _EXCALIDRAW in data))
        for subpath in _subpaths(element, matrix, f"shapes[{k}]")
    ]
    if not drawn:
        raise _invalid(
            "", "has nothing drawn in it; text and embedded pictures are not read, so draw paths"
        )
    tolerance = _TOLERANCE * _size([curve for subpath, _ in drawn for curve in subpath])
    steps = sum(_steps(curve, tolerance) for subpath, _ in drawn for curve in subpath)
    check_vertices(steps + len(drawn), "")
    return StrokeSet(
        tuple(
            Stroke(_flattened(subpath, tolerance) * (1.0, -1.0), None, label)
            for subpath, label in drawn
        )
    )


def _document(data: bytes) -> ElementTree.Element:
    """Parse XML, but no entities and no deep nesting."""
    try:
        _check(data)
        return ElementTree.fromstring(data)
    except InvalidInputError:
        raise
    except (expat.ExpatError, ElementTree.ParseError, LookupError, ValueError) as error:
        cause = str(error)[:_LONGEST_CAUSE]
        raise _invalid("", f"is not SVG ({cause}); save it as SVG again") from None


def _check(data: bytes) -> None:
    """Refuse what must not reach a parser that builds a tree."""
    depth = elements = vertices = 0

    def doctype(_name: str, _system: str | None, _public: str | None, subset: int) -> None:
        if subset:
            raise _invalid(
                "", "defines entities or a DTD of its own; save it as plain SVG without them"
            )

    def start(_name: str, attributes: dict[str, str]) -> None:
        nonlocal depth, elements, vertices
        depth += 1
        elements += 1
        vertices += sum(_vertices(attributes.get(name, "")) for name in _LISTS)
        _check_elements(elements)
        check_vertices(vertices, "")
        if depth > _MAX_DEPTH:
            raise _invalid(
                "", f"is nested deeper than the limit of {_MAX_DEPTH}; flatten its groups"
            )

    def end(_name: str) -> None:
        nonlocal depth
        depth -= 1

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = doctype
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.Parse(data, True)


def _check_elements(count: int) -> None:
    limit = source_limits().max_elements
    if count > limit:
        raise InvalidInputError(
            Reason.LIMIT_EXCEEDED,
            "",
            f"draws more than the limit of {limit} elements, a tenth of the vertices; simplify it, "
            "or raise limits.max_vertices (SKETCHMATCH_LIMITS__MAX_VERTICES)",
        )


def _vertices(data: str) -> int:
    """Return how many vertices path data or points have, roughly where they are few."""
    if len(data) < 1000:
        return len(data) // 4
    if not _COMMAND.search(data):
        return sum(1 for _ in _NUMBER.finditer(data)) // 2
    return sum(
        max(1, sum(1 for _ in _NUMBER.finditer(command[2])) // _ARITY[command[1].upper()])
        for command in _COMMAND.finditer(data)
    )


def _drawn(
    root: ElementTree.Element, excalidraw: bool
) -> Iterator[tuple[ElementTree.Element, Any, str]]:
    """Yield the shapes that are drawn, in order, each with its matrix to the drawing and label."""
    named = {element.get("id"): element for element in root.iter()}
    paper = _paper(root)
    stack = [(root, svgelements.Matrix(), "")]
    visited = 1
    while stack:
        element, outer, inherited = stack.pop()
        if element.get("display") == "none" or _HIDDEN.search(element.get("style", "")):
            continue
        matrix = _transform(element) * outer if "transform" in element.attrib else outer
        if _tag(element) in _SHAPES:
            if element is not paper:
                yield element, matrix, _label(element) or inherited
            continue
        inherited = _groups_label(element) or inherited
        if _tag(element) == "use":
            target = named.get(_reference(element))
            children = [] if target is None else [target]
            matrix = _offset(element) * matrix
        else:
            children = [child for child in element if _tag(child) in _DRAWN]
            if excalidraw and _tag(element) == "g":
                last = next((child for child in reversed(children) if _tag(child) == "path"), None)
                children = [c for c in children if _tag(c) != "path" or c is last]
        visited += len(children)
        _check_elements(visited)
        stack.extend((child, matrix, inherited) for child in reversed(children))


def _paper(root: ElementTree.Element) -> ElementTree.Element | None:
    """Return the rectangle that a tool laid under the drawing, if there is one."""
    shapes = (element for element in root.iter() if _tag(element) in _SHAPES)
    first = next(shapes, None)
    if first is None or _tag(first) != "rect":
        return None
    if first.get("stroke", "none") != "none" or _STROKED.search(first.get("style", "")):
        return None
    frame = root.get("viewBox", "").replace(",", " ").split()[2:]
    sizes = (root.get("width", ""), root.get("height", "")), tuple(frame), ("100%", "100%")
    return first if (first.get("width"), first.get("height")) in sizes else None


def _tag(element: ElementTree.Element) -> str:
    # Comments and processing instructions have a function for a tag.
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def _reference(use: ElementTree.Element) -> str:
    href = next((use.get(name, "") for name in _HREFS if name in use.attrib), "")
    return href[1:] if href.startswith("#") else ""


def _transform(element: ElementTree.Element) -> Any:
    text = element.get("transform", "")
    try:
        return svgelements.Matrix(text)
    except (ValueError, IndexError, TypeError):
        raise _invalid(
            "", f"has a transform that cannot be read: {text[:40]!r}; correct it"
        ) from None


def _offset(use: ElementTree.Element) -> Any:
    try:
        return svgelements.Matrix.translate(_length(use.get("x", "0")), _length(use.get("y", "0")))
    except ValueError:
        raise _invalid("", "has a <use> whose x or y is no length; correct it") from None


def _label(element: ElementTree.Element) -> str:
    own = element.get("id", "")
    return _given_label(element) or ("" if _TOOLS_ID.fullmatch(own) else own.strip())


def _groups_label(element: ElementTree.Element) -> str:
    """Return what the shapes of a group are called: nothing, if it is a layer or the drawing."""
    if _tag(element) == "svg" or element.get(f"{_INKSCAPE}groupmode") == "layer":
        return ""
    return _given_label(element)


def _given_label(element: ElementTree.Element) -> str:
    title = next((child.text for child in element if _tag(child) == "title"), None)
    names = (title, element.get("aria-label"), element.get(f"{_INKSCAPE}label"))
    return next((name.strip() for name in names if name and name.strip()), "")


def _subpaths(element: ElementTree.Element, matrix: Any, field: str) -> list[list[FloatArray]]:
    """Return a shape's subpaths, each as its curves' control points, (2…4, 2) a curve."""
    try:
        segments = _segments(element, matrix)
        curves = [np.array([p for p in part if p is not None], np.float64) for part in segments]
    except (ValueError, TypeError, IndexError, ArithmeticError, AttributeError):
        raise _unreadable(element, field, "a geometry that cannot be read") from None
    if element.get("d", "").strip() and not segments:
        raise _unreadable(element, field, "path data that cannot be read")
    subpaths: list[list[FloatArray]] = []
    ended = True
    for segment, controls in zip(segments, curves, strict=True):
        if not (np.abs(controls) < _LARGEST).all():
            raise _unreadable(element, field, "a coordinate that is no usable number")
        if isinstance(segment, svgelements.Move):
            ended = True
            continue
        if ended:
            subpaths.append([])
        ended = isinstance(segment, svgelements.Close)
        subpaths[-1].append(controls)
    return subpaths


def _segments(element: ElementTree.Element, matrix: Any) -> list[Any]:
    """Return a shape's moves, lines and Bézier curves in the drawing's coordinates."""
    path = svgelements.Path(_SHAPES[_tag(element)](_geometry(element))) * matrix
    return [
        part
        for segment in path.reify()
        for part in (
            segment.as_cubic_curves() if isinstance(segment, svgelements.Arc) else (segment,)
        )
    ]


def _geometry(element: ElementTree.Element) -> dict[str, Any]:
    """Return the attributes that say where a shape is; what has no extent is not drawn."""
    geometry: dict[str, Any] = dict.fromkeys(_EXTENT.get(_tag(element), ()), 0.0)
    for name, text in element.items():
        if name in _LENGTHS:
            geometry[name] = _length(text)
        elif name in _LISTS:
            geometry[name] = text
    return geometry


def _length(text: str) -> float:
    """Return a length in user units; relative ones have none here."""
    match = _LENGTH.fullmatch(text)
    if match is None:
        raise ValueError(text)
    return float(match[1]) * _UNITS[match[2].lower()]


def _size(curves: list[FloatArray]) -> float:
    return float(np.ptp(np.concatenate(curves), axis=0).max())


def _flattened(curves: list[FloatArray], tolerance: float) -> FloatArray:
    """Return points along curves that follow each other, shape (k, 2)."""
    points = [curves[0][:1]]
    points += [_samples(controls, tolerance)[1:] for controls in curves]
    return np.concatenate(points)


def _samples(controls: FloatArray, tolerance: float) -> FloatArray:
    """Return points along a Bézier curve, no farther from it than the tolerance."""
    steps = _steps(controls, tolerance)
    if steps == 1:
        return controls[[0, -1]]
    t = np.linspace(0.0, 1.0, steps + 1)[:, None, None]
    level = np.broadcast_to(controls, (steps + 1, *controls.shape))
    while level.shape[1] > 1:
        level = (1.0 - t) * level[:, :-1] + t * level[:, 1:]
    return level[:, 0]


def _steps(controls: FloatArray, tolerance: float) -> int:
    """Return into how many chords of equal steps a Bézier curve is cut.

    A curve of degree d leaves the chords of n equal steps by at most d(d−1)/8n² times the
    largest second difference of its control points.
    """
    degree = len(controls) - 1
    if degree < 2 or tolerance <= 0.0:
        return 1
    bend = float(np.hypot(*np.diff(controls, 2, axis=0).T).max())
    return max(1, math.ceil(math.sqrt(degree * (degree - 1) / 8.0 * bend / tolerance)))


def _unreadable(element: ElementTree.Element, field: str, problem: str) -> InvalidInputError:
    own = " ".join(element.get("id", "").split())[:_LONGEST_CAUSE]
    name = f' id="{own}"' if own else ""
    return _invalid(field, f"(<{_tag(element)}{name}>) has {problem}; draw it again")


def _invalid(field: str, problem: str) -> InvalidInputError:
    return InvalidInputError(Reason.INVALID_FILE, field, problem)
