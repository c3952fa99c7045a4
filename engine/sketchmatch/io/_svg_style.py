"""How style sheets and attributes say that an element of an SVG drawing is shown.

The cascade is that of CSS: presentation attributes, then rules of ``<style>`` elements by their
specificity, then the ``style`` attribute, and what is ``!important`` above all. Values that are no
legal ones are ignored, as browsers ignore them. Of media rules those for any screen hold; nothing
outside the document is ever opened, so ``@import`` has no effect.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any
from xml.etree import ElementTree

import cssselect2
import tinycss2
from cssselect2 import parser as selector_parser
from tinycss2 import color5

from sketchmatch.errors import InvalidInputError
from sketchmatch.io._svg_frame import NUMBER, css_transform, length
from sketchmatch.io._svg_tree import invalid, tag_of

__all__ = ["INITIAL", "Colour", "Look", "Styles"]

Colour = tuple[float, ...]
"""Red, green and blue; empty where it is visible, but not one colour or an unknown one."""

_SHARES = {"opacity", "fill-opacity", "stroke-opacity"}
_PAINTS = {"fill", "stroke"}
_INHERITED = {
    *_PAINTS,
    *{"visibility", "color", "fill-rule", "fill-opacity", "stroke-opacity", "stroke-width"},
    *{"stroke-dasharray", "marker-start", "marker-end", "font-size", "text-anchor"},
}
_TRANSFORMS = {"transform", "translate", "rotate", "scale", "transform-origin", "transform-box"}
_GEOMETRY = {"x", "y", "width", "height", "cx", "cy", "r", "rx", "ry", "d"}
_OWN = {"opacity", "display", "clip-path", "overflow"}
# What an attribute may say as CSS does. Of transforms and lengths its syntax is another.
_ATTRIBUTES = {*_INHERITED, *_OWN, "transform-origin", "transform-box"}
_TELLING = {*_ATTRIBUTES, "style"}
_KNOWN = {*_ATTRIBUTES, *_TRANSFORMS, *_GEOMETRY, "background", "background-color"}
_WIDE = {"inherit", "initial", "unset", "revert", "revert-layer"}
_VISIBLE = {"visible": True, "hidden": False, "collapse": False}
_RULES = {"nonzero": False, "evenodd": True}
_ANCHORS = {"start": 0.0, "middle": 0.5, "end": 1.0}

_LENGTHS = _GEOMETRY - {"d"}

_PLAIN = re.compile(r"[^\"'\\/{}!(]*")
# Each looks at a character once: what is possessive never tries again with less.
_EMBEDDED = re.compile(r"url\(\s*+[\"']?data:[^)]*+(?:\)|\Z)", re.IGNORECASE)
_URL = re.compile(r"""url\(\s*+["']?([^"')]*+)["']?\s*+\)\s*+(.*)""", re.IGNORECASE | re.DOTALL)
_SCREEN = re.compile(r"\s*+((only\s++)?(all|screen))?+\s*+", re.IGNORECASE)
_SHARE = re.compile(rf"({NUMBER})(%?)", re.IGNORECASE)

# A number without a unit, as attributes may have it.
_UNITLESS = re.compile(rf"(?<![\w.%+-])({NUMBER})(?=[\s,]|$)", re.IGNORECASE)
_CUSTOM = "--"
# What no number needs, and Python refuses from 4300 on.
_MANY_DIGITS = re.compile(r"(\d{400})\d++")
# How long a value may become by the custom properties that it refers to, and how many these are.
_LONGEST_VALUE, _MOST_REFERENCES = 1000, 16

# A style sheet may be this long, and take this many tests of elements.
_LONGEST, _MOST_TESTS = 1_000_000, 3_000_000
# Selectors that look at an element's siblings are followed in drawings of this many elements.
_FEW = 500
_AROUND = re.compile(r"~(?!=)|:has\(|-of-type|:nth-")


@dataclass(frozen=True, slots=True)
class Look:
    """How an element is shown, as far as a sketch is concerned.

    Attributes
    ----------
    visible
        Whether ``visibility`` shows it.
    fill, stroke, color
        Paint as it is written, and what ``currentColor`` stands for.
    fill_opacity, stroke_opacity, stroke_width
        As shares and in user units.
    stroke_dasharray
        How long its longest dash is, in user units; infinite where its line has no gaps.
    fill_rule
        Whether it is ``evenodd``.
    marker_start, marker_end
        Identities of what its ends are drawn with, or empty.
    font_size
        In user units.
    text_anchor
        Which share of a text lies before its place.
    opacity
        Of all of it, its parents' among them, as a share.
    displayed
        Whether anything of it is shown, that is neither ``display`` nor ``opacity`` hides it.
    clip_path
        Identity of what it is clipped by, or empty.
    overflow
        Whether what lies outside of its viewport is shown.
    transforms, geometry
        What CSS says of where it is, by property.
    custom
        The custom properties that values refer to by ``var()``.
    """

    visible: bool = True
    fill: str = "black"
    stroke: str = "none"
    color: str = "black"
    fill_opacity: float = 1.0
    stroke_opacity: float = 1.0
    stroke_width: float = 1.0
    stroke_dasharray: float = math.inf
    fill_rule: bool = False
    marker_start: str = ""
    marker_end: str = ""
    font_size: float = 16.0
    text_anchor: float = 0.0
    opacity: float = 1.0
    displayed: bool = True
    clip_path: str = ""
    overflow: bool = False
    transforms: Mapping[str, str] = field(default_factory=dict)
    geometry: Mapping[str, str] = field(default_factory=dict)
    custom: Mapping[str, str] = field(default_factory=dict)


INITIAL = Look()
_OWN_FIELDS = {
    name: getattr(INITIAL, name)
    for name in ("displayed", "clip_path", "overflow", "transforms", "geometry")
}


class Styles:
    """The style sheets of a document.

    Raises
    ------
    InvalidInputError
        If they are too long, or too costly to follow.
    """

    def __init__(self, root: ElementTree.Element, named: Mapping[str, ElementTree.Element]) -> None:
        self._named = named
        self._matcher = cssselect2.Matcher()
        self._wrapped: dict[ElementTree.Element, cssselect2.ElementWrapper] = {}
        self._passed_on = 0
        sheets = [
            "".join(element.itertext())
            for element in root.iter()
            if tag_of(element) == "style"
            and element.get("type", "").strip().lower() in ("", "text/css")
            and _SCREEN.fullmatch(element.get("media", ""))
        ]
        text = _shortened(_EMBEDDED.sub("url()", "\n".join(sheets)))
        if len(text) > _LONGEST:
            raise _costly("is longer than a million characters")
        try:
            nodes = tinycss2.parse_stylesheet(text, True, True)
            rules = [
                (rule.prelude, declared)
                for rule in _rules(nodes)
                if (declared := [*_of_interest(rule.content)])
            ]
            if rules:
                self._add(root, rules, _namespaces(nodes))
        except (RecursionError, MemoryError, SyntaxError):
            raise _costly("is nested too deeply") from None

    def _add(
        self,
        root: ElementTree.Element,
        rules: list[tuple[Any, list[_Said]]],
        namespaces: dict[str | None, str],
    ) -> None:
        elements, names, depth = _counted(root)
        tests = 0
        for prelude, declared in rules:
            if elements > _FEW and _AROUND.search(tinycss2.serialize(prelude)):
                raise _costly("selects elements by their siblings in so large a drawing")
            try:
                compiled = cssselect2.compile_selector_list(prelude, namespaces)
                parsed = selector_parser.parse(prelude, namespaces)
                trees = [each.parsed_tree for each in parsed]
            except (cssselect2.SelectorError, NotImplementedError):
                continue  # a browser drops it, too
            for selector, tree in zip(compiled, trees, strict=True):
                tests += _cost(tree, depth) * _candidates(selector, elements, names)
                if tests > _MOST_TESTS:
                    raise _costly("has too many rules for so large a drawing")
                if selector.pseudo_element is None:
                    self._matcher.add_selector(selector, declared)
        wrapper = cssselect2.ElementWrapper.from_xml_root(root)
        self._wrapped = {each.etree_element: each for each in wrapper.iter_subtree()}

    def look(self, element: ElementTree.Element, parent: Look) -> Look:
        """Return how an element is shown whose parent, or ``use``, is shown as told."""
        if not self._wrapped and _TELLING.isdisjoint(element.keys()):
            return _inherited(parent)
        try:
            values, custom = self._declared(element, parent.custom)
        except RecursionError:
            raise _costly("is nested too deeply") from None
        changes: dict[str, Any] = {}
        for name in _INHERITED & values.keys():
            text = values[name].lower()
            if name == "font-size" and text not in _WIDE:
                changes["font_size"] = length(text, parent.font_size, parent.font_size)
            elif text not in _WIDE:
                changes[name.replace("-", "_")] = _VALUES[name](values[name])
            elif text == "initial":
                attribute = _attribute(name)
                changes[attribute] = getattr(INITIAL, attribute)
        if "visibility" in changes:
            changes["visible"] = changes.pop("visibility")
        if changes.get("color", "").lower() == "currentcolor":
            del changes["color"]
        own = {name: text for name, text in values.items() if text.lower() not in _WIDE}
        opacity = _share(own.get("opacity"))
        return replace(
            _inherited(parent),
            **changes,
            opacity=parent.opacity * min(max(opacity, 0.0), 1.0),
            displayed=own.get("display", "").lower() != "none" and opacity > 0.0,
            clip_path=_target(own.get("clip-path", "")),
            overflow=own.get("overflow", "").lower() in ("visible", "auto"),
            transforms={name: own[name] for name in _TRANSFORMS & own.keys()},
            geometry={name: own[name] for name in _GEOMETRY & own.keys()},
            custom=custom,
        )

    def background(self, root: ElementTree.Element) -> Colour:
        """Return the colour of the page, white where none is given."""
        values, _ = self._declared(root, {})
        text = values.get("background-color", values.get("background", ""))
        return self.paint(text, 1.0, "black") or (1.0, 1.0, 1.0)

    def filled(self, look: Look) -> Colour | None:
        """Return the colour of what fills a shape, or None."""
        return self.paint(look.fill, look.fill_opacity, look.color)

    def hides(self, look: Look) -> bool:
        """Whether nothing is seen through what fills a shape."""
        text = look.color if look.fill.lower() == "currentcolor" else look.fill
        parsed = None if _URL.match(text) else _parsed_colour(text)
        plain = parsed is not None and parsed != "currentcolor" and parsed.alpha >= 1.0
        return plain and look.fill_opacity >= 1.0 and look.opacity >= 1.0

    def stroked(self, look: Look) -> Colour | None:
        """Return the colour of a shape's line, or None."""
        if look.stroke_width <= 0.0:
            return None
        return self.paint(look.stroke, look.stroke_opacity, look.color)

    def paint(self, text: str, opacity: float, color: str) -> Colour | None:
        """Return the colour that one sees of a paint, or None."""
        if opacity <= 0.0:
            return None
        if match := _URL.match(text):
            if match[1].strip().removeprefix("#") in self._named:
                return ()
            text = match[2] or "none"
        if text.lower() == "currentcolor":
            text = color
        return _colour(text)

    def _declared(
        self, element: ElementTree.Element, inherited: Mapping[str, str]
    ) -> tuple[dict[str, str], Mapping[str, str]]:
        """Return the legal values that hold for an element, by property, and the custom ones."""
        said: list[_Said] = [
            (name, _with_units(name, _shortened(text)), False)
            for name, text in element.items()
            if name in _ATTRIBUTES
        ]
        wrapped = self._wrapped.get(element)
        if wrapped is not None:
            for *_, declared in self._matcher.match(wrapped):
                said += declared
        said += _inline(_shortened(element.get("style", "")))
        said.sort(key=lambda each: each[2])
        custom = inherited
        if named := {name: text for name, text, _ in said if name.startswith(_CUSTOM)}:
            custom = {**inherited, **named}
            self._passed_on += len(custom)
            if self._passed_on > _MOST_TESTS:
                raise _costly("has too many custom properties for so large a drawing")
        values = ((name, _substituted(text, custom)) for name, text, _ in said if name in _KNOWN)
        return {name: text for name, text in values if _legal(name, text)}, custom


_Said = tuple[str, str, bool]


def _rules(nodes: Iterable[Any]) -> Iterator[Any]:
    """Yield the style rules that hold on a screen, in their order."""
    for node in nodes:
        if node.type == "qualified-rule":
            yield node
        elif node.type == "at-rule" and node.content is not None:
            name, prelude = node.lower_at_keyword, tinycss2.serialize(node.prelude)
            if name in ("supports", "layer") or (name == "media" and _SCREEN.fullmatch(prelude)):
                yield from _rules(tinycss2.parse_rule_list(node.content, True, True))


def _namespaces(nodes: Iterable[Any]) -> dict[str | None, str]:
    """Return what prefixes of selectors stand for."""
    spaces: dict[str | None, str] = {}
    for node in nodes:
        if node.type == "at-rule" and node.lower_at_keyword == "namespace":
            tokens = [
                token for token in node.prelude if token.type not in ("whitespace", "comment")
            ]
            prefix = tokens[0].value if len(tokens) > 1 and tokens[0].type == "ident" else None
            if tokens and tokens[-1].type in ("string", "url"):
                spaces[prefix] = tokens[-1].value
            elif tokens and tokens[-1].type == "function" and tokens[-1].arguments:
                spaces[prefix] = tokens[-1].arguments[0].value
    return spaces


def _of_interest(content: Any) -> Iterator[_Said]:
    for node in tinycss2.parse_blocks_contents(content, True, True):
        if node.type == "declaration":
            name = node.name if node.name.startswith(_CUSTOM) else node.lower_name
            if name in _KNOWN or name.startswith(_CUSTOM):
                yield name, tinycss2.serialize(node.value).strip(), node.important
        elif node.type == "qualified-rule" and [*_of_interest(node.content)]:
            raise _costly("has rules within rules")


@lru_cache(maxsize=1024)
def _inline(style: str) -> tuple[_Said, ...]:
    """Return what a ``style`` attribute says."""
    if not _PLAIN.fullmatch(style):
        return tuple(_of_interest(style))
    pairs = (item.partition(":") for item in style.split(";"))
    named = ((name.strip().lower(), text.strip()) for name, _, text in pairs)
    return tuple(
        (name, text, False) for name, text in named if name in _KNOWN or name.startswith(_CUSTOM)
    )


def _shortened(text: str) -> str:
    """Return CSS without digits that are more than Python makes a number of."""
    return _MANY_DIGITS.sub(r"\1", text)


def _with_units(name: str, text: str) -> str:
    """Return the value of an attribute as CSS would have it."""
    return _UNITLESS.sub(r"\1px", text) if name == "transform-origin" else text.strip()


def _substituted(text: str, custom: Mapping[str, str]) -> str:
    """Return a value with the custom properties put in that it refers to; empty if it cannot be."""
    for _ in range(_MOST_REFERENCES):
        if "var(" not in text.lower():
            return text
        tokens = tinycss2.parse_component_value_list(text)
        k = next((k for k, token in enumerate(tokens) if _refers(token)), None)
        if k is None:
            return text
        name, _, otherwise = tinycss2.serialize(tokens[k].arguments).partition(",")
        value = custom.get(name.strip(), otherwise).strip()
        text = tinycss2.serialize(tokens[:k]) + value + tinycss2.serialize(tokens[k + 1 :])
        if not value or len(text) > _LONGEST_VALUE:
            return ""
    return ""


@lru_cache(maxsize=4096)
def _legal(name: str, text: str) -> bool:
    """Whether a browser takes a value; what is no CSS of today it ignores."""
    if text.lower() in _WIDE:
        return True
    try:
        if name in _VALUES:
            _VALUES[name](text)
        elif name in _TRANSFORMS:
            css_transform({name: text}, None)
        elif name in _LENGTHS and _UNITLESS.fullmatch(text):
            return float(text) == 0.0
    except InvalidInputError:
        return True  # it is refused where it is used
    except (ValueError, KeyError):
        return False
    return bool(text)


def _refers(token: Any) -> bool:
    return bool(token.type == "function" and token.lower_name == "var")


def _paint_text(text: str) -> str:
    known = text.lower() in ("none", "") or text.lower().startswith(("url(", "context-"))
    if not known and _colour(text) is None and not _transparent(text):
        raise ValueError(text)
    return text


@lru_cache(maxsize=1024)
def _parsed_colour(text: str) -> Any:
    return color5.parse_color(text, "light")


def _transparent(text: str) -> bool:
    parsed = _parsed_colour(text)
    return parsed is not None and parsed != "currentcolor" and parsed.alpha == 0.0


@lru_cache(maxsize=1024)
def _colour(text: str) -> Colour | None:
    """Return what a paint shows that is no reference, or None."""
    parsed = _parsed_colour(text)
    if parsed is None:
        # A function that is too new to be known here shows something.
        return () if text.lower().startswith("context-") or "(" in text else None
    if parsed == "currentcolor":
        return ()
    if parsed.alpha <= 0.0:
        return None
    try:
        seen = parsed.to("srgb")
    except NotImplementedError:
        return ()
    return tuple(round(value or 0.0, 4) for value in seen.coordinates)


def _share(text: str | None) -> float:
    if text is None:
        return 1.0
    match = _SHARE.fullmatch(text)
    if match is None:
        raise ValueError(text)
    return float(match[1]) / (100.0 if match[2] else 1.0)


def _length(text: str) -> float:
    return length(text, 100.0)


def _longest_dash(text: str) -> float:
    """Return how long the longest dash is: infinite if there are no gaps."""
    if text.lower() == "none":
        return math.inf
    lengths = [_length(each) for each in re.split(r"[\s,]+", text.strip())]
    if min(lengths) < 0.0:
        raise ValueError(text)
    # An odd number of them is gone through twice, so that each is a dash and a gap.
    even = len(lengths) % 2 == 0
    dashes, gaps = (lengths[::2], lengths[1::2]) if even else (lengths, lengths)
    return max(dashes) if any(gaps) else math.inf


def _target(text: str) -> str:
    match = _URL.match(text)
    return match[1].strip().removeprefix("#") if match else ""


_VALUES: dict[str, Any] = {
    **dict.fromkeys(_PAINTS, _paint_text),
    **dict.fromkeys(_SHARES, _share),
    "color": _paint_text,
    **dict.fromkeys(("stroke-width", "font-size"), _length),
    "stroke-dasharray": _longest_dash,
    "visibility": lambda text: _VISIBLE[text.lower()],
    "fill-rule": lambda text: _RULES[text.lower()],
    "marker-start": _target,
    "marker-end": _target,
    "text-anchor": lambda text: _ANCHORS[text.lower()],
}


def _inherited(look: Look) -> Look:
    """Return how a child is shown of which nothing is said."""
    own = look.clip_path or look.overflow or look.transforms or look.geometry
    if look.displayed and not own:
        return look
    return replace(look, **_OWN_FIELDS)


def _attribute(name: str) -> str:
    return "visible" if name == "visibility" else name.replace("-", "_")


def _counted(root: ElementTree.Element) -> tuple[int, Counter[tuple[str, str]], int]:
    """Return how many elements there are, in all and of each name, and how deep they nest."""
    names: Counter[tuple[str, str]] = Counter()
    count = deepest = 0
    stack = [(root, 1)]
    while stack:
        element, depth = stack.pop()
        count, deepest = count + 1, max(deepest, depth)
        names["tag", tag_of(element).lower()] += 1
        names["id", element.get("id", "")] += 1
        names.update(("class", name) for name in set(element.get("class", "").split()))
        stack.extend((child, depth + 1) for child in element)
    return count, names, deepest


def _candidates(selector: Any, elements: int, names: Counter[tuple[str, str]]) -> int:
    """Return how many elements a selector is tested on."""
    if selector.id is not None:
        return names["id", selector.id]
    if selector.class_name is not None:
        return names["class", selector.class_name]
    if selector.local_name is not None:
        return names["tag", selector.lower_local_name]
    return elements


def _cost(tree: Any, depth: int) -> int:
    """Return how many simple tests a selector can take on one element."""
    if isinstance(tree, selector_parser.CombinedSelector):
        often = depth if tree.combinator == " " else _FEW if tree.combinator == "~" else 1
        return _cost(tree.right, depth) + often * _cost(tree.left, depth)
    cost = 0
    for simple in tree.simple_selectors:
        inner = getattr(simple, "selector_list", ())
        # Of :has(), the selectors are relative ones.
        trees = [getattr(each, "selector", each).parsed_tree for each in inner]
        relative = isinstance(simple, selector_parser.RelationalSelector)
        named = getattr(simple, "name", "")
        around = relative or "nth" in str(named) or "of-type" in str(named)
        cost += (_FEW if around else 1) * (1 + sum(_cost(each, depth) for each in trees))
    return max(1, cost)


def _costly(problem: str) -> InvalidInputError:
    return invalid("", f"has a style sheet that {problem}; save it as plain SVG without one")
