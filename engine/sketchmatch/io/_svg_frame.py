"""Where an element of an SVG drawing is: lengths, viewports and transforms."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

import svgelements
import tinycss2

from sketchmatch.errors import InvalidInputError
from sketchmatch.io._svg_tree import invalid

__all__ = ["NUMBER", "Frame", "css_transform", "fitted", "length", "view_box"]

NUMBER = r"[-+]?(?:\d++\.?+\d*+|\.\d++)(?:e[-+]?\d++)?+"
"""Pattern of a number, in whatever case; it looks at a character once."""

_LENGTH = re.compile(rf"\s*+({NUMBER})(px|pt|pc|mm|cm|in|q|em|ex|ch|%|)\s*", re.IGNORECASE)
_UNITS = {
    **{"": 1.0, "px": 1.0, "pt": 4 / 3, "pc": 16.0, "in": 96.0},
    **{"mm": 96 / 25.4, "cm": 96 / 2.54, "q": 96 / 101.6},
}
# As browsers have it for a font of which they know nothing.
_FONTS = {"em": 1.0, "ex": 0.5, "ch": 0.5}
_DEGREES = {"deg": 1.0, "rad": 180.0 / math.pi, "grad": 0.9, "turn": 360.0}
_ALIGN = {"Min": 0.0, "Mid": 0.5, "Max": 1.0}
_ASPECT = re.compile(r"\s*(?:defer\s+)?x(Min|Mid|Max)Y(Min|Mid|Max)(?:\s+(meet|slice))?\s*")
_KEYWORDS = {"left": (0, 0.0), "right": (0, 1.0), "top": (1, 0.0), "bottom": (1, 1.0)}
_ORDER = ("translate", "rotate", "scale", "transform")
_FILL_BOXES = {"fill-box", "content-box"}
_OWN_BOXES = {*_FILL_BOXES, "stroke-box", "border-box"}


@dataclass(frozen=True, slots=True)
class Frame:
    """A viewport, in the units of what is drawn in it."""

    x: float
    y: float
    width: float
    height: float


def length(text: str, along: float | None, font_size: float = 16.0) -> float:
    """Return a length in user units.

    Parameters
    ----------
    text
        As in the attribute.
    along
        What percentages are shares of, or None where that is unknown.
    font_size
        In user units.

    Raises
    ------
    ValueError
        If it is no length, or one that is relative to what is unknown.
    """
    match = _LENGTH.fullmatch(text)
    if match is None:
        raise ValueError(text)
    unit = match[2].lower()
    if unit == "%":
        if along is None:
            raise ValueError(text)
        return float(match[1]) / 100.0 * along
    return float(match[1]) * (_FONTS[unit] * font_size if unit in _FONTS else _UNITS[unit])


def view_box(element: ElementTree.Element) -> Frame | None:
    """Return the part of the plane that an element shows, or None where it does not say so."""
    numbers = [float(each) for each in re.findall(NUMBER, element.get("viewBox", ""), re.I)]
    if len(numbers) != 4 or not all(map(math.isfinite, numbers)) or min(numbers[2:]) < 0.0:
        return None
    return Frame(*numbers)


def fitted(shown: Frame, into: Frame, aspect: str) -> Any:
    """Return the matrix that fits what a ``viewBox`` shows into a viewport."""
    across, down = into.width / shown.width, into.height / shown.height
    x, y = into.x, into.y
    if aspect.strip() != "none":
        match = _ASPECT.fullmatch(aspect)
        align_x, align_y, how = match.groups() if match else ("Mid", "Mid", "meet")
        across = down = max(across, down) if how == "slice" else min(across, down)
        x += _ALIGN[align_x] * (into.width - across * shown.width)
        y += _ALIGN[align_y] * (into.height - down * shown.height)
    return svgelements.Matrix(across, 0.0, 0.0, down, x - across * shown.x, y - down * shown.y)


def css_transform(
    said: Mapping[str, str],
    frame: Frame | None,
    attribute: Any = None,
    own: Callable[[], Frame | None] = lambda: None,
) -> Any:
    """Return the matrix of the transforms that CSS tells of an element.

    Parameters
    ----------
    said
        Values by property: ``transform``, ``translate``, ``rotate``, ``scale``,
        ``transform-origin``, ``transform-box``.
    frame
        The nearest viewport, which percentages are shares of.
    attribute
        Matrix of the attribute ``transform``, which the property replaces.
    own
        Returns the box around the element itself, which percentages are shares of with
        ``transform-box: fill-box``; None where that is not known.

    Raises
    ------
    ValueError
        If CSS does not know such a value.
    InvalidInputError
        If it is legal, but cannot be followed here.
    """
    box = said.get("transform-box", "").strip().lower()
    inner = own() if box in _FILL_BOXES else None
    reference = inner or frame
    size = (reference.width, reference.height) if reference else (None, None)
    matrix = svgelements.Matrix()
    for name in _ORDER:
        if name in said:
            matrix = _matrix(name, said[name], size) * matrix
        elif name == "transform" and attribute is not None:
            matrix = attribute * matrix
    x, y = _origin(said.get("transform-origin", "0 0"), size)
    if inner is not None:
        x, y = x + inner.x, y + inner.y
    elif box in _OWN_BOXES and not _only_shifts(matrix):
        raise invalid(
            "", f"has a transform about its own box (transform-box: {box}); write it as a matrix"
        )
    if x or y:
        matrix = svgelements.Matrix.translate(-x, -y) * matrix * svgelements.Matrix.translate(x, y)
    return matrix


_Size = tuple[float | None, float | None]


def _only_shifts(matrix: Any) -> bool:
    return bool((matrix.a, matrix.b, matrix.c, matrix.d) == (1.0, 0.0, 0.0, 1.0))


def _matrix(name: str, text: str, size: _Size) -> Any:
    """Return the matrix of one of the properties."""
    tokens = [t for t in tinycss2.parse_component_value_list(text, True) if t.type != "whitespace"]
    if len(tokens) == 1 and tokens[0].type == "ident" and tokens[0].lower_value == "none":
        return svgelements.Matrix()
    if any(token.type == "function" and token.lower_name in ("var", "env") for token in tokens):
        raise _unfollowed(text)
    if name != "transform":
        return _single(name, tokens, size)
    matrix = svgelements.Matrix()
    for token in tokens:
        if token.type != "function":
            raise ValueError(text)
        matrix = _function(token.lower_name, _arguments(token), size, text) * matrix
    if not tokens:
        raise ValueError(text)
    return matrix


def _single(name: str, tokens: list[Any], size: _Size) -> Any:
    """Return the matrix of ``translate``, ``rotate`` or ``scale``."""
    if not 1 <= len(tokens) <= 3:
        raise ValueError(name)
    if name == "rotate":
        if len(tokens) == 2 and getattr(tokens[0], "lower_value", "") == "z":
            tokens = tokens[1:]
        elif len(tokens) > 1:
            raise _unfollowed("rotate about an axis")
    return _function(name, tokens, size, name)


def _arguments(function: Any) -> list[Any]:
    """Return the arguments of a function that are parted by commas."""
    tokens = [token for token in function.arguments if token.type not in ("whitespace", "comment")]
    values, commas = tokens[::2], tokens[1::2]
    if len(tokens) % 2 == 0 or any(token != "," for token in commas):
        raise ValueError(function.name)
    return values


def _function(name: str, values: list[Any], size: _Size, text: str) -> Any:  # noqa: PLR0911
    """Return the matrix of one function; what only moves in depth is not seen."""
    if any(value.type == "function" for value in values):
        raise _unfollowed(text)
    count = len(values)
    matrix = svgelements.Matrix
    if name == "matrix" and count == 6:
        return matrix(*(_number(value) for value in values))
    if name in ("translate", "translate3d") and 1 <= count <= 3:
        x = _distance(values[0], size[0])
        return matrix.translate(x, _distance(values[1], size[1]) if count > 1 else 0.0)
    if name == "translatex" and count == 1:
        return matrix.translate(_distance(values[0], size[0]), 0.0)
    if name == "translatey" and count == 1:
        return matrix.translate(0.0, _distance(values[0], size[1]))
    if name in ("scale", "scale3d") and 1 <= count <= 3:
        x = _number(values[0])
        return matrix.scale(x, _number(values[1]) if count > 1 else x)
    if name in ("scalex", "scaley") and count == 1:
        x = _number(values[0])
        return matrix.scale(x, 1.0) if name == "scalex" else matrix.scale(1.0, x)
    if name in ("rotate", "rotatez") and count == 1:
        return matrix.rotate(_radians(values[0]))
    if name in ("skew", "skewx", "skewy") and 1 <= count <= 2:
        first = math.tan(_radians(values[0]))
        other = math.tan(_radians(values[1])) if count == 2 else 0.0
        x, y = (0.0, first) if name == "skewy" else (first, other)
        return matrix(1.0, y, x, 1.0, 0.0, 0.0)
    if name in ("translatez", "scalez") and count == 1:
        return matrix()
    if name in ("matrix3d", "rotate3d", "rotatex", "rotatey", "perspective"):
        raise _unfollowed(text)
    raise ValueError(text)


def _origin(text: str, size: _Size) -> tuple[float, float]:
    """Return the point that is kept."""
    tokens = [t for t in tinycss2.parse_component_value_list(text, True) if t.type != "whitespace"]
    if not 1 <= len(tokens) <= 3:
        raise ValueError(text)
    where: list[float | None] = [None, None]
    for k, token in enumerate(tokens[:2]):
        if token.type == "ident" and token.lower_value in _KEYWORDS:
            axis, share = _KEYWORDS[token.lower_value]
            where[axis] = share * _known(size[axis])
        elif token.type == "ident" and token.lower_value == "center":
            axis = 1 if where[0] is not None else k
            where[axis] = 0.5 * _known(size[axis])
        else:
            where[k] = _distance(token, size[k])
    x, y = (0.5 * _known(size[k]) if each is None else each for k, each in enumerate(where))
    return x, y


def _known(size: float | None) -> float:
    # Where nothing says how large the page is, no share of it moves anything.
    return 0.0 if size is None else size


def _number(token: Any) -> float:
    if token.type == "number":
        return float(token.value)
    if token.type == "percentage":
        return float(token.value) / 100.0
    raise ValueError(token.type)


def _distance(token: Any, along: float | None) -> float:
    if token.type == "percentage":
        return float(token.value) / 100.0 * _known(along)
    if token.type == "number" and token.value == 0.0:
        return 0.0
    if token.type == "dimension" and token.lower_unit in _UNITS:
        return float(token.value) * _UNITS[token.lower_unit]
    raise ValueError(token.type)


def _radians(token: Any) -> float:
    if token.type == "number" and token.value == 0.0:
        return 0.0
    if token.type == "dimension" and token.lower_unit in _DEGREES:
        return math.radians(float(token.value) * _DEGREES[token.lower_unit])
    raise ValueError(token.type)


def _unfollowed(text: str) -> InvalidInputError:
    shown = " ".join(text.split())[:40]
    return invalid("", f"has a transform that cannot be followed ({shown}); write it as a matrix")
