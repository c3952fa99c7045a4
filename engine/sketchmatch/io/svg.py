"""Strokes from an SVG drawing, as vector tools and sketch pads export it.

What a browser shows becomes strokes, as it shows it: every ``path``, ``line``, ``polyline``,
``polygon``, ``rect``, ``circle`` and ``ellipse`` one, every further subpath one more, with all
transforms applied and y turned up; a closed shape repeats its first point, and so does an open one
that is filled. ``use``, ``symbol`` and nested ``svg`` are followed within the document. Pictures
are ignored; texts, also those written as HTML, are names of places. Coordinates are user units:
``viewBox`` scales a drawing as a whole, which a match does not see, unless it stretches it.

Style sheets, ``style`` and attributes decide alike: what has neither a line nor a filling that
could be seen is no shape, nor is what ``display``, ``visibility``, ``opacity``, a clip, ``switch``
or the edge of a nested ``svg`` hide; but what lies beyond the page is read. What cannot be
followed, as a turn in space, is refused.

A shape's label is the first that it has of: its ``<title>``, ``aria-label``, ``inkscape:label``,
``serif:id``, ``data-name``, and an ``id`` that a person gave (``desk-2``, but not a tool's
``path123``; ``_x0020_`` in it is a space); or else that of the innermost group with one of all
these but an ``id`` which is no layer.

A line with an arrowhead, or another marker, at both of its ends says how long something is, and is
no shape; nor is an arrowhead that is drawn by itself. Paper is none: a filled rectangle without a
line that is seen, which covers the whole page, or lies under all else. Of a shape that is drawn
once filled and once as a line, the line is taken; of the paths with which Excalidraw draws one, its
hatching or filling first, the last: the outline, every line of which is drawn twice. A pen stroke
that was exported as the outline of its ink becomes the line again
(:mod:`sketchmatch.io._svg_ink`).

Nothing outside the document is ever opened. Entities may be short words, as Illustrator's are; a
document that defines others is refused.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache, partial
from typing import Any, NamedTuple
from xml.etree import ElementTree

import svgelements

from sketchmatch.api.documents import load_xml
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io._svg_curves import (
    LISTS,
    SHAPES,
    TOLERANCE,
    size_of,
    steps_of,
    subpaths_of,
)
from sketchmatch.io._svg_frame import NUMBER, Frame, css_transform, fitted, length, view_box
from sketchmatch.io._svg_names import (
    goes_on,
    groups_label,
    html_in,
    is_vertical,
    label_of,
    size_of_html,
    width_of,
    written_in,
)
from sketchmatch.io._svg_shapes import (
    Box,
    Shape,
    box_of,
    is_closed,
    lines_of,
    without_heads,
    without_paper,
    without_twins,
)
from sketchmatch.io._svg_style import INITIAL, Colour, Look, Styles
from sketchmatch.io._svg_tree import LONGEST_CAUSE, invalid, named_element, tag_of
from sketchmatch.model import Landmark, Stroke, StrokeSet
from sketchmatch.model.limits import check_vertices, source_limits

__all__ = ["decode_svg"]

_DRAWN = {*SHAPES, "svg", "g", "a", "switch", "use"}
_VIEWPORTS = {"svg", "symbol"}
_HTML = "foreignObject"
# Of the height of letters: a line that is longer may go on beyond what it is written in.
_LONG = 4.0
_WRITTEN = {"text", _HTML}
_HREFS = ("href", "{http://www.w3.org/1999/xlink}href")
_EXCALIDRAW = b"svg-source:excalidraw"
_COMMAND = re.compile(r"([MLHVCSQTAZ])([^MLHVCSQTAZ]*)", re.IGNORECASE)
_NUMBER = re.compile(NUMBER, re.IGNORECASE)
_ARITY = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 1}


def decode_svg(data: bytes) -> StrokeSet:
    """Decode what an SVG document shows as strokes, in the order they are drawn.

    Parameters
    ----------
    data
        The document, in any encoding that it declares.

    Raises
    ------
    InvalidInputError
        If it is not SVG, defines entities that are no words, is too large or nested too deeply,
        has nothing drawn in it, uses what cannot be followed, or a shape cannot be read; then its
        path is ``shapes[k]``, counted from 0. What is too large
        :func:`sketchmatch.model.limits.source_limits` says.

    Examples
    --------
    >>> sketch = decode_svg(b'<svg><g transform="translate(5)"><path d="M0 1h2v1z"/></g></svg>')
    >>> sketch.strokes[0].points.tolist()
    [[5.0, -1.0], [7.0, -1.0], [7.0, -2.0], [5.0, -1.0]]
    """
    root, lines = _document(data)
    if tag_of(root) != "svg":
        raise invalid(
            "",
            f"is XML but not SVG: it begins with <{tag_of(root)[:LONGEST_CAUSE]}>; save it as SVG",
        )
    drawing = _Drawing(root, lines, data)
    shapes = [shape for shape in drawing.shapes() if shape.subpaths]
    shapes, ground = without_paper(shapes, drawing.page, drawing.background)
    shapes, dimensions = without_heads(without_twins(shapes))
    if not shapes:
        raise invalid(
            "", "has nothing drawn in it; text and embedded pictures are not read, so draw paths"
        )
    curves = [curve for shape in shapes for subpath in shape.subpaths for curve in subpath]
    tolerance = TOLERANCE * size_of(curves)
    check_vertices(
        sum(steps_of(curve, tolerance) for curve in curves)
        + sum(1 + shape.filled for shape in shapes for _ in shape.subpaths),
        "",
    )
    return StrokeSet(
        tuple(
            Stroke(points * (1.0, -1.0), None, shape.label, shape.dashed, shape.width, shape.opaque)
            for shape in shapes
            for points in lines_of(shape, tolerance)
        ),
        (
            *(
                f"{each.place} was taken as the paper and left out: all else lies on it."
                for each in ground
            ),
            *_note_on_dimensions([*drawing.dimensions, *dimensions]),
        ),
        tuple(drawing.names),
    )


def _note_on_dimensions(places: list[str]) -> Iterator[str]:
    if places:
        if len(places) > 1:
            were = f"and {len(places) - 1} more were left out as dimension lines: they have"
        else:
            were = "was left out as a dimension line: it has"
        yield f"{places[0]} {were} arrowheads at both ends."


def _document(data: bytes) -> tuple[ElementTree.Element, list[int]]:
    """Parse a document whose tree is not too large to be built; the lines are those of elements."""
    vertices, most = 0, source_limits().max_elements
    lines: list[int] = []

    def watch(attributes: Mapping[str, str], line: int) -> None:
        nonlocal vertices
        lines.append(line)
        vertices += sum(_vertices(attributes.get(name, "")) for name in LISTS)
        _check_elements(len(lines), most)
        check_vertices(vertices, "")

    return load_xml(data, "SVG", watch), lines


def _check_elements(count: int, limit: int) -> None:
    if count > limit:
        raise InvalidInputError(
            Reason.LIMIT_EXCEEDED,
            "",
            f"draws more than the limit of {limit} elements, a tenth of that of vertices; simplify "
            "it, or raise limits.max_vertices (SKETCHMATCH_LIMITS__MAX_VERTICES)",
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


class _Context(NamedTuple):
    """What an element inherits from those around it, and from those that use it."""

    matrix: Any
    look: Look
    label: str
    frame: Frame | None
    clip: Box | None
    size: tuple[str | None, str | None] = (None, None)
    used: frozenset[ElementTree.Element] = frozenset()


class _Drawing:
    """A document, of which all that is shown is sought."""

    def __init__(self, root: ElementTree.Element, lines: list[int], data: bytes) -> None:
        self._root = root
        self._lines = dict(zip(root.iter(), lines, strict=True))
        self._named = {each.get("id", ""): each for each in reversed([*root.iter()])}
        self._parents = {child: each for each in root.iter() for child in each}
        self._styles = Styles(root, self._named)
        # What is used again and again is the same each time.
        self._label = cache(groups_label)
        self._children = cache(partial(_children, excalidraw=_EXCALIDRAW in data))
        self._target = cache(self._used)
        self._visited = 1
        self._most = source_limits().max_elements
        self.background = self._styles.background(root)
        self.page: Box | None = None
        self.names: list[Landmark] = []
        # The last text, if nothing was drawn since, and its own line of the last name.
        self._above: tuple[ElementTree.Element, Landmark] | None = None
        self.dimensions: list[str] = []

    def shapes(self) -> Iterator[Shape]:
        """Yield the shapes that are shown, in the order they are drawn."""
        count = 0
        stack = [(self._root, _Context(svgelements.Matrix(), INITIAL, "", None, None))]
        while stack:
            element, outer = stack.pop()
            look = self._styles.look(element, outer.look)
            if not look.displayed or not _for_us(element):
                continue
            tag = tag_of(element)
            if tag in _WRITTEN:
                self._name(element, look, outer)
                continue
            inner = outer._replace(
                look=look, size=(None, None), matrix=self._placed(element, look, outer)
            )
            if look.clip_path:
                inner = inner._replace(clip=_both(inner.clip, self._clip(look.clip_path, inner)))
            if tag in SHAPES:
                self._above = None
                fill, stroke = self._styles.filled(look), self._styles.stroked(look)
                if inner.frame is None and stroke is None and fill and _is_whole(element):
                    self.background = fill
                elif look.visible and (fill is not None or stroke is not None):
                    shape = self._shape(element, inner, fill, stroke, f"shapes[{count}]")
                    count += 1
                    if self._says_a_length(look, shape):
                        self.dimensions.append(shape.place)
                    elif shape.subpaths and _meet(shape.box, inner.clip):
                        yield shape
                continue
            if label := self._label(element):
                inner = inner._replace(label=label)
            if tag in _VIEWPORTS:
                inside = self._viewport(element, inner, outer.size)
                if inside is None:
                    continue
                inner = inside
            children, inner = self._contents(element, inner)
            self._visit(len(children))
            stack.extend((child, inner) for child in reversed(children))

    def _name(self, text: ElementTree.Element, look: Look, context: _Context) -> None:
        """Add what a text says to the names, or to the last of them."""
        if tag_of(text) == _HTML:
            self._above = None
            self.names.extend(self._written_html(text, look, context))
            return
        for line, middle in self._written(text, look, context):
            name = replace(line, point=middle)
            if self._above and goes_on(*self._above, text, line):
                last = self.names.pop()
                name = replace(last, name=f"{last.name} {line.name}")
            self.names.append(name)
            self._above = text, line

    def _written(
        self, text: ElementTree.Element, look: Look, context: _Context
    ) -> Iterator[tuple[Landmark, tuple[float, float]]]:
        """Yield what a text says, where it is placed and how large it is, unless that is not known.

        With it the middle of its first line, or of what begins or ends a long one.
        """
        name = written_in(text)
        placed = [(text, look)]
        for part, around in placed:
            spans = (child for child in part if tag_of(child) == "tspan")
            placed += [(span, self._styles.look(span, around)) for span in spans]
        try:
            own = svgelements.Matrix(text.get("transform", "")) * context.matrix
            x, y = (
                next(
                    (
                        length(re.split(r"[\s,]+", places.strip())[0], along, shown.font_size)
                        for part, shown in placed
                        if (places := part.get(axis))
                    ),
                    0.0,
                )
                for axis, along in zip("xy", _sides(context.frame), strict=True)
            )
            told = next((shown for part, shown in placed if (part.text or "").strip()), look)
            across = 0.0 if any(is_vertical(part) for part, _ in placed) else width_of(text)
            aside = (0.5 - told.text_anchor) * min(across, _LONG) * told.font_size
            point, middle = (own.point_in_matrix_space((at, y)) for at in (x, x + aside))
        except (ValueError, IndexError, TypeError):
            return
        size = _scale(own) * max(shown.font_size for _, shown in placed)
        known = all(map(math.isfinite, (point.x, point.y, middle.x, middle.y, size)))
        if look.visible and name and known:
            line = Landmark(name, (float(point.x), -float(point.y)), "room", size)
            yield line, (float(middle.x), -float(middle.y))

    def _written_html(
        self, html: ElementTree.Element, look: Look, context: _Context
    ) -> Iterator[Landmark]:
        """Yield what is written as HTML, in the middle of its box, unless that is not known.

        Where a picture stands for it, for those who read none, the box is the picture's.
        """
        name = html_in(html)
        others = [*self._parents[html]] if tag_of(self._parents[html]) == "switch" else []
        boxed = next((each for each in others if tag_of(each) == "image"), html)
        try:
            own = svgelements.Matrix(html.get("transform", "")) * context.matrix
            x, y, width, height = (
                length(boxed.get(side, "0"), None, look.font_size)
                for side in ("x", "y", "width", "height")
            )
            point = own.point_in_matrix_space((x + width / 2.0, y + height / 2.0))
        except (ValueError, IndexError, TypeError):
            return
        size = _scale(own) * (size_of_html(html) or look.font_size)
        if look.visible and name and all(map(math.isfinite, (point.x, point.y, size))):
            yield Landmark(name, (float(point.x), -float(point.y)), "room", size)

    def _says_a_length(self, look: Look, shape: Shape) -> bool:
        """Whether a shape is an open line, both ends of which are marked."""
        ends = (self._named.get(look.marker_start), self._named.get(look.marker_end))
        marked = all(end is not None and tag_of(end) == "marker" for end in ends)
        return marked and shape.stroke is not None and not any(map(is_closed, shape.subpaths))

    def _place(self, element: ElementTree.Element) -> str:
        return f"{named_element(element)} on line {self._lines[element]} of the file"

    def _visit(self, count: int) -> None:
        self._visited += count
        _check_elements(self._visited, self._most)

    def _shape(
        self,
        element: ElementTree.Element,
        context: _Context,
        fill: Colour | None,
        stroke: Colour | None,
        field: str,
    ) -> Shape:
        line, look = self._lines[element], context.look
        subpaths = subpaths_of(element, look, context.frame, context.matrix, field, line)
        # Whoever gives both the same colour has fattened the ink.
        pen = tag_of(element) in ("path", "polygon") and fill is not None and stroke in (None, fill)
        box = box_of(subpaths)
        flat = all(len(each) == 1 and len(each[0]) == 2 for each in subpaths)
        # A line that is no longer than a dash may have no gap.
        scale = _scale(context.matrix)
        dash = look.stroke_dasharray * scale
        return Shape(
            subpaths,
            label_of(element) or context.label,
            fill,
            stroke,
            look.fill_rule,
            pen,
            self._place(element),
            box,
            (fill is None or flat) and dash < max(box[2] - box[0], box[3] - box[1]),
            look.stroke_width * scale if stroke is not None else 0.0,
            # Ink may become another line, and holes are seen through.
            not (pen or stroke is None or context.clip or len(subpaths) > 1)
            and self._styles.hides(look),
        )

    def _contents(
        self, element: ElementTree.Element, context: _Context
    ) -> tuple[list[ElementTree.Element], _Context]:
        """Return what is drawn of an element that is no shape, and in which context."""
        if tag_of(element) != "use":
            return self._children(element), context
        target = self._target(element)
        if target is None or target in context.used:
            return [], context  # what would draw itself without end is not drawn
        return [target], context._replace(
            matrix=self._offset(element, context),
            size=(element.get("width"), element.get("height")),
            used=context.used | {target},
        )

    def _used(self, use: ElementTree.Element) -> ElementTree.Element | None:
        """Return what a ``use`` draws, unless that is nothing, or what the ``use`` lies in."""
        href = next((use.get(name, "") for name in _HREFS if name in use.attrib), "").strip()
        if href and not href.startswith("#"):
            raise self._invalid(
                use, "draws something from another file, which is never opened; embed it"
            )
        target = self._named.get(href[1:]) if href else None
        if target is None or tag_of(target) not in {*_DRAWN, "symbol"}:
            return None
        return None if target in self._around(use) else target

    def _around(self, element: ElementTree.Element | None) -> Iterator[ElementTree.Element]:
        while element is not None:
            yield element
            element = self._parents.get(element)

    def _placed(self, element: ElementTree.Element, look: Look, context: _Context) -> Any:
        """Return the matrix from an element's coordinates to the drawing's."""
        attribute = None
        if "transform" in element.attrib:
            text = element.get("transform", "")
            try:
                attribute = svgelements.Matrix(text)
            except (ValueError, IndexError, TypeError):
                raise self._invalid(
                    element, f"has a transform that cannot be read: {text[:40]!r}; correct it"
                ) from None
        if look.transforms:
            try:
                attribute = css_transform(
                    look.transforms,
                    context.frame,
                    attribute,
                    lambda: self._own_box(element, look, context.frame),
                )
            except InvalidInputError as error:
                raise self._invalid(element, error.problem) from None
        return context.matrix if attribute is None else attribute * context.matrix

    def _own_box(
        self, element: ElementTree.Element, look: Look, frame: Frame | None
    ) -> Frame | None:
        """Return the box around a shape in its own coordinates; of a group it is not known."""
        if tag_of(element) not in SHAPES:
            return None
        line = self._lines[element]
        identity = svgelements.Matrix()
        subpaths = subpaths_of(element, look, frame, identity, "", line)
        x0, y0, x1, y1 = box_of(subpaths)
        return Frame(x0, y0, x1 - x0, y1 - y0)

    def _offset(self, use: ElementTree.Element, context: _Context) -> Any:
        frame, said = context.frame, context.look.geometry
        if not (said or "x" in use.attrib or "y" in use.attrib):
            return context.matrix
        try:
            x, y = (
                length(said.get(axis, use.get(axis, "0")), along, context.look.font_size)
                for axis, along in zip("xy", _sides(frame), strict=True)
            )
        except ValueError:
            raise self._invalid(use, "has an x or y that is not a length; correct it") from None
        return svgelements.Matrix.translate(x, y) * context.matrix

    def _viewport(
        self,
        element: ElementTree.Element,
        context: _Context,
        size: tuple[str | None, str | None],
    ) -> _Context | None:
        """Return the context within an ``svg`` or a used ``symbol``; None if it shows nothing."""
        shown = view_box(element)
        if shown is not None and not (shown.width and shown.height):
            return None
        if element is self._root:
            return self._first_viewport(element, context, shown)
        said, frame = context.look.geometry, context.frame
        frame = frame or (shown and Frame(0.0, 0.0, shown.width, shown.height))
        across, down = _sides(frame)
        try:
            x, y, width, height = (
                None
                if frame is None and text.endswith("%")
                else length(text, along, context.look.font_size)
                for text, along in (
                    (said.get("x", element.get("x", "0")), across),
                    (said.get("y", element.get("y", "0")), down),
                    (size[0] or said.get("width", element.get("width", "100%")), across),
                    (size[1] or said.get("height", element.get("height", "100%")), down),
                )
            )
        except ValueError:
            raise self._invalid(
                element, "has a place or size that is not a length; correct it"
            ) from None
        into = None
        if width is not None and height is not None:
            if width <= 0.0 or height <= 0.0:
                return None
            into = Frame(x or 0.0, y or 0.0, width, height)
        if into is not None and not context.look.overflow:
            box = _boxed(into, context.matrix)
            context = context._replace(clip=_both(context.clip, box))
        if shown is not None and into is not None:
            matrix = fitted(shown, into, element.get("preserveAspectRatio", ""))
            return context._replace(matrix=matrix * context.matrix, frame=shown)
        matrix = svgelements.Matrix.translate(x or 0.0, y or 0.0) * context.matrix
        return context._replace(matrix=matrix, frame=into and replace(into, x=0.0, y=0.0))

    def _first_viewport(
        self, root: ElementTree.Element, context: _Context, shown: Frame | None
    ) -> _Context | None:
        """Return the context within the document, in its user units unless it is stretched."""
        size: Frame | None
        try:
            width, height = (
                length(root.get(side, ""), None, context.look.font_size)
                for side in ("width", "height")
            )
            size = Frame(0.0, 0.0, width, height)
        except ValueError:
            size = None
        if size is not None and not (size.width > 0.0 and size.height > 0.0):
            size = None
        frame = shown or size
        if frame is None:
            return context
        if shown and size and root.get("preserveAspectRatio", "").strip() == "none":
            stretch = (size.height / shown.height) / (size.width / shown.width)
            matrix = svgelements.Matrix.scale(1.0, stretch) * context.matrix
            context = context._replace(matrix=matrix)
        self.page = _boxed(frame, context.matrix)
        return context._replace(frame=frame)

    def _clip(self, name: str, context: _Context) -> Box | None:
        """Return a box around what a clip lets through, or None where that is not known."""
        clip = self._named.get(name)
        if clip is None or tag_of(clip) != "clipPath":
            return None
        if clip.get("clipPathUnits") == "objectBoundingBox" or any(
            tag_of(child) in ("use", "text") for child in clip
        ):
            return None
        self._visit(len(clip))
        matrix = self._placed(clip, self._styles.look(clip, INITIAL), context)
        subpaths = []
        for child in clip:
            if tag_of(child) in SHAPES:
                look = self._styles.look(child, INITIAL)
                inner = context._replace(matrix=matrix)
                placed = self._placed(child, look, inner)
                line = self._lines[child]
                subpaths += subpaths_of(child, look, context.frame, placed, "", line)
        return box_of(subpaths)

    def _invalid(self, element: ElementTree.Element, problem: str) -> InvalidInputError:
        where = f"({named_element(element)} on line {self._lines[element]} of the file)"
        return invalid("", f"{where} {problem}")


def _children(element: ElementTree.Element, excalidraw: bool) -> list[ElementTree.Element]:
    """Return what is drawn of what an element contains."""
    children = [child for child in element if tag_of(child) in {*_DRAWN, *_WRITTEN}]
    if tag_of(element) == "switch":
        # What is written as HTML is mostly written once more, as text, for those who read none.
        able = (child for child in element if tag_of(child) not in ("", _HTML))
        shown = next((child for child in able if _for_us(child)), None)
        if shown is None or tag_of(shown) == "image":
            return [child for child in children if tag_of(child) == _HTML]
        return [child for child in children if child is shown]
    if excalidraw and tag_of(element) == "g":
        last = next((child for child in reversed(children) if tag_of(child) == "path"), None)
        children = [c for c in children if tag_of(c) != "path" or c is last]
    return children


def _scale(matrix: Any) -> float:
    """Return how many times as long lines become, in the mean of all directions."""
    return math.sqrt(abs(matrix.a * matrix.d - matrix.b * matrix.c))


def _sides(frame: Frame | None) -> tuple[float, float] | tuple[None, None]:
    return (frame.width, frame.height) if frame else (None, None)


def _is_whole(element: ElementTree.Element) -> bool:
    """Whether a rectangle is as large as a page of which nothing says how large it is."""
    return tag_of(element) == "rect" and element.get("width") == element.get("height") == "100%"


def _for_us(element: ElementTree.Element) -> bool:
    """Whether the conditions hold under which an element is shown."""
    languages = element.get("systemLanguage")
    english = languages is None or any(
        each.strip().lower().startswith("en") for each in languages.split(",")
    )
    return english and "requiredExtensions" not in element.attrib


def _boxed(frame: Frame, matrix: Any) -> Box:
    """Return the box around a viewport, in the drawing's coordinates."""
    right, low = frame.x + frame.width, frame.y + frame.height
    corners = [(frame.x, frame.y), (right, frame.y), (right, low), (frame.x, low)]
    x, y = zip(*(matrix.point_in_matrix_space(corner) for corner in corners), strict=True)
    return (min(x), min(y), max(x), max(y))


def _both(first: Box | None, second: Box | None) -> Box | None:
    if first is None or second is None:
        return first or second
    low = tuple(max(a, b) for a, b in zip(first[:2], second[:2], strict=True))
    high = tuple(min(a, b) for a, b in zip(first[2:], second[2:], strict=True))
    return (low[0], low[1], high[0], high[1])


def _meet(box: Box, other: Box | None) -> bool:
    """Whether two boxes have a point in common; nothing is outside of an unknown one."""
    return other is None or (
        box[0] <= other[2] and other[0] <= box[2] and box[1] <= other[3] and other[1] <= box[3]
    )
