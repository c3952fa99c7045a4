"""What shapes, groups and texts of an SVG document are called."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from xml.etree import ElementTree

from sketchmatch.io._svg_tree import tag_of
from sketchmatch.model import Landmark

__all__ = [
    "goes_on",
    "groups_label",
    "html_in",
    "is_vertical",
    "label_of",
    "size_of_html",
    "width_of",
    "written_in",
]

_INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"
_NAMES = ("aria-label", f"{_INKSCAPE}label", "{http://www.serif.com/}id", "data-name")
_TOOLS_ID = re.compile(
    r"(path|line|polyline|polygon|rect|circle|ellipse|use|g|svg|svgid|xmlid|shape|stroke|object"
    r"|vector|element|layer|rectangle|square|oval|triangle|star|curve|arrow|group|frame|artboard"
    r"|fill|union|subtract|intersect|exclude|combined[\W_]shape|compound[\W_]path)?[\W\d_]*",
    re.IGNORECASE,
)
# What tools call layers, where nothing but the name says that it is one.
_LAYER = re.compile(
    r"(layer|ebene|calque|capa|livello|laag|слой|图层|レイヤー)\W*\d*", re.IGNORECASE
)
# What Illustrator adds to the names of all but one of several that are called alike.
_COPY = re.compile(r"(?<=.)_\d+_$")
# How Illustrator and CorelDRAW write what an ``id`` may not contain.
_ESCAPED = re.compile(r"_x([0-9A-F]{2,5})_", re.IGNORECASE)

# Of the height of letters: how far apart the lines of a name are at most, and those of one that
# ends or begins with a sign that joins words, and how far aside the next line begins.
_SPACED, _SPACED_JOINED, _ASIDE = 1.6, 2.2, 0.1
# Of the height of letters: how wide those of most alphabets are, and those as wide as high.
_NARROW, _WIDE = 0.5, 1.0
_VERTICAL = re.compile(r"writing-mode\s*:\s*(?:tb|vertical)", re.IGNORECASE)
# Elements of HTML that part no lines, and how large their letters are.
_WITHIN_LINES = frozenset(
    ("a", "b", "code", "em", "font", "i", "span", "strong", "sub", "sup", "u")
)
_FONT_SIZE = re.compile(r"font-size:\s*(\d+(?:\.\d+)?)px", re.IGNORECASE)
_JOINED = re.compile(r"[/&+,-]\n|\n[/&+]")


def label_of(element: ElementTree.Element) -> str:
    """Return what a shape is called: nothing, if a tool gave it its name."""
    own = _ESCAPED.sub(_unescaped, element.get("id", ""))
    if label := _given_label(element):
        return label
    return "" if _TOOLS_ID.fullmatch(own) else _spaced(_COPY.sub("", own))


def _unescaped(escaped: re.Match[str]) -> str:
    """Return the character that an escape stands for; one that cannot be seen stays as it is."""
    char = chr(int(escaped[1], 16))
    return char if char == " " or char.isprintable() else escaped[0]


def groups_label(element: ElementTree.Element) -> str:
    """Return what the shapes of a group are called: nothing, if it is a layer or the drawing."""
    if tag_of(element) == "svg" or element.get(f"{_INKSCAPE}groupmode") == "layer":
        return ""
    label = _given_label(element)
    return "" if _LAYER.fullmatch(label) else label


def _given_label(element: ElementTree.Element) -> str:
    titles = ("".join(child.itertext()) for child in element if tag_of(child) == "title")
    names = (next(titles, ""), *(element.get(name, "") for name in _NAMES))
    return next((name for name in map(_spaced, names) if name), "")


def written_in(text: ElementTree.Element) -> str:
    """Return what a text says, its lines with spaces between them."""
    said, last = "", None
    for line, part in _lines_of(text, ""):
        said += f" {part}" if line != last else part
        last = line
    return _spaced(said)


def width_of(text: ElementTree.Element) -> float:
    """Return how wide the first line of a text is, as a share of its letters' height: about."""
    lines = [*_lines_of(text, "")]
    first = next((line for line, part in lines if part.strip()), "")
    said = _spaced("".join(part for line, part in lines if line == first))
    return sum(_WIDE if unicodedata.east_asian_width(each) in "FW" else _NARROW for each in said)


def is_vertical(text: ElementTree.Element) -> bool:
    """Whether an element says that its letters are below each other."""
    said = f"writing-mode:{text.get('writing-mode', '')};{text.get('style', '')}"
    return _VERTICAL.search(said) is not None


def html_in(element: ElementTree.Element) -> str:
    """Return what is written as HTML in an element, its lines with spaces between them."""
    return _spaced("".join(_html_of(element)))


def _html_of(element: ElementTree.Element) -> Iterator[str]:
    """Yield the words of an element, and what parts those of its lines."""
    tag = tag_of(element)
    if tag in ("", "style", "script"):
        return
    apart = "" if tag in _WITHIN_LINES else " "
    yield apart + (element.text or "")
    for child in element:
        yield from _html_of(child)
        yield child.tail or ""
    yield apart


def size_of_html(element: ElementTree.Element) -> float:
    """Return how high the largest letters of HTML in an element are; 0 if it does not tell."""
    styles = (each.get("style", "") for each in element.iter())
    return max(
        (float(found[1]) for text in styles for found in _FONT_SIZE.finditer(text)), default=0.0
    )


def goes_on(
    above: ElementTree.Element, first: Landmark, text: ElementTree.Element, second: Landmark
) -> bool:
    """Whether a text is the next line of a name whose line above is a text, too.

    It is written in the same manner right below, or joined by a sign such as ``&``. Texts with
    numbers, as measures have them, stand alone.
    """
    both = f"{first.name}\n{second.name}"
    joined = _JOINED.search(both) is not None
    size = max(first.size, second.size)
    down = first.point[1] - second.point[1]
    return (
        0.0 < down <= (_SPACED_JOINED if joined else _SPACED) * size
        and abs(first.point[0] - second.point[0]) <= _ASIDE * size
        and not re.search(r"\d", both)
        and (joined or _manner(above) == _manner(text))
    )


def _manner(text: ElementTree.Element) -> dict[str, str]:
    """Return all that a text's attributes say but which and where it is."""
    return {name: said for name, said in text.items() if name not in ("id", "x", "y")}


def _lines_of(part: ElementTree.Element, line: object) -> Iterator[tuple[object, str]]:
    """Yield the parts of a text, each with what tells its line from others."""
    line = part if part.get("dy") else part.get("y", line)
    yield line, part.text or ""
    for child in part:
        if tag_of(child) not in ("", "title", "desc"):
            yield from _lines_of(child, line)
        if child.tail:
            yield line, child.tail


def _spaced(text: str) -> str:
    """Return text with its white space as a browser shows it."""
    return " ".join(text.split())
