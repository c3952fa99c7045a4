"""Drawings of Excalidraw."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from sketchmatch.api import InvalidInputError, Reader, Reason
from sketchmatch.api.documents import (
    decode_text,
    listed,
    load_json,
    mapping,
    number,
    sequence,
    shown,
)
from sketchmatch.model import FloatArray, Landmark, Stroke, StrokeSet
from sketchmatch.model.limits import check_vertices

from ._areas import box, check_elements, ellipse, within_reach

__all__ = ["ExcalidrawReader"]

_STROKE = Reason.INVALID_STROKE
_CLOSED = {"rectangle", "ellipse", "diamond"}
_DRAWN = {*_CLOSED, "line", "freedraw"}
_FRAMES = {"frame", "magicframe"}
_OTHERS = {
    "arrow": "arrows",
    "image": "pictures",
    "embeddable": "web pages",
    "iframe": "web pages",
    "selection": "selections",
}
# As Excalidraw rounds corners: by a share of the smaller side, or by a length where that is less.
_ROUND_SHARE, _ROUND_LENGTH = 0.25, 32.0
_ARC, _CURVE = 6, 8
# Beyond this no size is one.
_LARGEST = 1e15
# A colour of four parts, of which the last, how much is seen of it, is not all.
_SEEN_THROUGH = re.compile(
    r"#[0-9a-f]{6}(?!ff)[0-9a-f]{2}|#[0-9a-f]{3}(?!f)[0-9a-f]", re.IGNORECASE
)


@dataclass(frozen=True, eq=False)
class _Element:
    """One element as far as all kinds have the same."""

    kind: str
    data: dict[str, Any]
    field: str
    id: str
    frame: str

    def text(self, key: str) -> str:
        value = self.data.get(key)
        return value if isinstance(value, str) else ""

    def number(self, key: str, otherwise: float | None = None) -> float:
        value = self.data.get(key)
        if value is None and otherwise is not None:
            return otherwise
        return number(value, f"{self.field}.{key}", _STROKE)

    def size(self, key: str) -> float:
        """Return what is not needed to read a drawing: 0 where it is no size."""
        value = self.data.get(key)
        if isinstance(value, bool) or not isinstance(value, int | float):
            return 0.0
        return float(value) if 0.0 <= value < _LARGEST else 0.0


class ExcalidrawReader(Reader):
    """Reads the shapes of a drawing as strokes, whether drawn by hand or not.

    Rectangles, ellipses, diamonds, lines and freehand strokes are strokes, in their order; arrows,
    pictures and what was deleted or is invisible are not. A text that is bound to a shape, grouped
    with one alone, or lies over it is the shape's name, and all texts but those of arrows are names
    of rooms to the segmenter ``rooms``, to which lines with gaps are no walls. Frames are no
    shapes; their names choose what is read, as in ``house.excalidraw#kitchen``.

    References
    ----------
    Excalidraw, "JSON schema", docs.excalidraw.com/docs/codebase/json-schema.

    Examples
    --------
    >>> box = '{"type": "rectangle", "id": "a", "x": 0, "y": 0, "width": 4, "height": 2}'
    >>> text = '{"type": "text", "id": "b", "containerId": "a", "text": "desk", "x": 1, "y": 1}'
    >>> data = f'{{"type": "excalidraw", "elements": [{box}, {text}]}}'
    >>> [stroke.label for stroke in ExcalidrawReader().read(data.encode()).strokes]
    ['desk']
    """

    name = "excalidraw"
    summary = "A drawing of Excalidraw; FILE#FRAME chooses a frame."
    suffixes = (".excalidraw",)
    keys = ("type", "elements")
    source = StrokeSet

    def read(self, data: bytes, part: str = "") -> StrokeSet:
        """Return the shapes as strokes, y upwards."""
        document = mapping(load_json(decode_text(data)), "", _STROKE, "a drawing")
        kind = document.get("type")
        if not (isinstance(kind, str) and kind.startswith("excalidraw")):
            raise InvalidInputError(
                _STROKE, "type", f"is {shown(kind)}; give a drawing of type excalidraw"
            )
        elements = list(_elements(document))
        check_elements(len(elements), "elements", "elements")
        frames = {each.id: each.text("name") for each in elements if each.kind in _FRAMES}
        inside = _in_frame(elements, frames, part)
        shapes = [each for each in inside if each.kind in _DRAWN and _visible(each)]
        outlines = [within_reach(_outline(each)) for each in shapes]
        check_vertices(sum(map(len, outlines)), "")
        if not shapes:
            raise InvalidInputError(
                _STROKE, "elements", "has no shape in it; draw rectangles, ellipses or strokes"
            )
        texts = [each for each in inside if each.kind == "text"]
        names = _names(texts, shapes, outlines)
        strokes = (
            Stroke(
                outline * (1.0, -1.0),
                None,
                " ".join(names.get(k, ())),
                _dashed(each),
                each.size("strokeWidth"),
                _opaque(each),
            )
            for k, (each, outline) in enumerate(zip(shapes, outlines, strict=True))
        )
        held = {each.id for each in shapes}
        free = [
            each
            for each in texts
            if not each.data.get("containerId") or each.text("containerId") in held
        ]
        return StrokeSet(
            tuple(strokes), tuple(_notes(inside, frames, part)), tuple(_landmarks(free))
        )


def _elements(document: dict[str, Any]) -> Iterator[_Element]:
    """Yield the elements that were not deleted."""
    items = sequence(document.get("elements"), "elements", _STROKE, "a list of elements")
    for k, item in enumerate(items):
        field = f"elements[{k}]"
        data = mapping(item, field, _STROKE, "an element")
        kind = data.get("type")
        if not isinstance(kind, str):
            raise InvalidInputError(_STROKE, f"{field}.type", f"is {shown(kind)}; give a name")
        if data.get("isDeleted") is not True:
            frame = data.get("frameId")
            yield _Element(kind, data, field, str(data.get("id", k)), str(frame) if frame else "")


def _in_frame(
    elements: Sequence[_Element], frames: dict[str, str], part: str
) -> Sequence[_Element]:
    """Return the elements in the frame of a name; all, if none is named."""
    if not part:
        return elements
    wanted = [key for key, name in frames.items() if part in (name, key)]
    if not wanted:
        known = listed(name or key for key, name in frames.items()) or "none"
        raise InvalidInputError(
            Reason.INVALID_FILE, "", f"has no frame {listed([part])}; choose one of: {known}"
        )
    return [each for each in elements if each.frame in wanted]


def _visible(each: _Element) -> bool:
    if each.data.get("opacity") == 0:
        return False
    paints = (each.data.get("strokeColor", "#000000"), each.data.get("backgroundColor"))
    return any(paint not in (None, "", "transparent") for paint in paints)


def _dashed(each: _Element) -> bool:
    """Whether nothing of an element is seen but a line with gaps."""
    empty = each.data.get("backgroundColor") in (None, "", "transparent")
    return empty and each.data.get("strokeStyle") in ("dashed", "dotted")


def _opaque(each: _Element) -> bool:
    """Whether a shape hides what was drawn there before."""
    paint = each.text("backgroundColor")
    plain = paint not in ("", "transparent") and not _SEEN_THROUGH.fullmatch(paint)
    solid = each.data.get("fillStyle") == "solid" and each.data.get("opacity", 100) == 100
    return each.kind in _CLOSED and plain and solid


def _landmarks(texts: Sequence[_Element]) -> Iterator[Landmark]:
    """Yield what texts say, in their middles."""
    for each in texts:
        name = " ".join((each.text("originalText") or each.text("text")).split())
        x, y = _middle(each)
        if name and math.isfinite(x) and math.isfinite(y):
            yield Landmark(name, (x, -y), "room", each.size("fontSize"))


def _middle(text: _Element) -> tuple[float, float]:
    x, y, width, height = (text.number(key, 0.0) for key in ("x", "y", "width", "height"))
    return x + width / 2, y + height / 2


def _notes(elements: Sequence[_Element], frames: dict[str, str], part: str) -> Iterator[str]:
    others = [_OTHERS.get(each.kind, f"elements of type {each.kind[:40]}") for each in elements]
    plain = {*_DRAWN, *_FRAMES, "text"}
    counts: dict[str, int] = {}
    for each, what in zip(elements, others, strict=True):
        if each.kind not in plain:
            counts[what] = counts.get(what, 0) + 1
    if counts:
        listed_counts = ", ".join(f"{what} ({count})" for what, count in counts.items())
        yield f"Left out because they are not objects: {listed_counts}."
    used = {frames[each.frame] or each.frame for each in elements if each.frame in frames}
    if not part and len(used) > 1:
        yield f"All {len(used)} frames were read; FILE#FRAME reads one: {listed(sorted(used))}."


def _outline(each: _Element) -> FloatArray:
    """Return an element's line, turned as it is, y down; a closed one repeats its first point."""
    x, y = each.number("x"), each.number("y")
    if each.kind in _CLOSED:
        width, height = each.number("width"), each.number("height")
        ring = _ring(each, x, y, width, height)
        points = np.vstack([ring, ring[:1]])
    else:
        points = _line(each) + np.array([x, y])
    angle = each.number("angle", 0.0)
    if angle == 0.0 or len(points) == 0:
        return points
    middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
    c, s = math.cos(angle), math.sin(angle)
    turned: FloatArray = middle + (points - middle) @ np.array([[c, s], [-s, c]])
    return turned


def _ring(each: _Element, x: float, y: float, width: float, height: float) -> FloatArray:
    if each.kind == "ellipse":
        return ellipse(x + width / 2, y + height / 2, abs(width) / 2, abs(height) / 2)
    if each.kind == "diamond":
        corners = [(0.5, 0.0), (1.0, 0.5), (0.5, 1.0), (0.0, 0.5)]
        return np.array(corners) * (width, height) + (x, y)
    x0, x1 = sorted((x, x + width))
    y0, y1 = sorted((y, y + height))
    radius = _radius(each, min(x1 - x0, y1 - y0))
    return box(x0, y0, x1, y1) if radius == 0.0 else _rounded(x0, y0, x1, y1, radius)


def _radius(each: _Element, side: float) -> float:
    roundness = each.data.get("roundness")
    kind = roundness.get("type") if isinstance(roundness, dict) else None
    share = _ROUND_SHARE * side
    return min(share, _ROUND_LENGTH) if kind == 3 else share if kind in (1, 2) else 0.0


def _rounded(x0: float, y0: float, x1: float, y1: float, r: float) -> FloatArray:
    middles = [(x1 - r, y1 - r), (x0 + r, y1 - r), (x0 + r, y0 + r), (x1 - r, y0 + r)]
    angles = np.linspace(0.0, math.pi / 2, _ARC)
    arcs = [
        np.column_stack([r * np.cos(angles + turn), r * np.sin(angles + turn)]) + middle
        for middle, turn in zip(middles, np.arange(4) * math.pi / 2, strict=True)
    ]
    return np.vstack(arcs)


def _line(each: _Element) -> FloatArray:
    """Return the points of a line or freehand stroke, from its own origin."""
    field = f"{each.field}.points"
    rows = []
    for k, point in enumerate(
        sequence(each.data.get("points"), field, _STROKE, "a list of [x, y]")
    ):
        pair = sequence(point, f"{field}[{k}]", _STROKE, "[x, y]")
        if len(pair) < 2:
            raise InvalidInputError(_STROKE, f"{field}[{k}]", f"is {shown(pair)}; give [x, y]")
        rows.append([number(pair[i], f"{field}[{k}][{i}]", _STROKE) for i in (0, 1)])
    points = np.array(rows, dtype=np.float64).reshape(-1, 2)
    curved = each.kind == "line" and isinstance(each.data.get("roundness"), dict)
    return _curve(points) if curved and len(points) > 2 else points


def _curve(points: FloatArray) -> FloatArray:
    """Return points of the curve through others, as Excalidraw draws it: Catmull and Rom's."""
    before = np.vstack([points[:1], points[:-2]])
    after = np.vstack([points[2:], points[-1:]])
    begin, end = points[:-1], points[1:]
    first, second = begin + (end - before) / 6.0, end - (after - begin) / 6.0
    t = np.arange(_CURVE).reshape(-1, 1) / _CURVE
    spans = [
        (1 - t) ** 3 * a + 3 * (1 - t) ** 2 * t * b + 3 * (1 - t) * t**2 * c + t**3 * d
        for a, b, c, d in zip(begin, first, second, end, strict=True)
    ]
    return np.vstack([*spans, points[-1:]])


def _names(
    texts: Sequence[_Element], shapes: Sequence[_Element], outlines: Sequence[FloatArray]
) -> dict[int, list[str]]:
    """Return the texts of each shape that has some, in their order."""
    hulls = np.array([shapely.MultiPoint(outline).convex_hull for outline in outlines])
    places, tree = _Places(shapes), shapely.STRtree(hulls)
    names: dict[int, list[str]] = {}
    for each in texts:
        k = places.named(each, tree)
        if k is not None and (said := each.text("originalText") or each.text("text")):
            names.setdefault(k, []).append(said)
    return names


class _Places:
    """Which shape a text is the name of."""

    def __init__(self, shapes: Sequence[_Element]) -> None:
        self._by_id: dict[str, int] = {}
        self._by_group: dict[str, list[int]] = {}
        for k, shape in enumerate(shapes):
            self._by_id.setdefault(shape.id, k)
            for group in _groups(shape):
                self._by_group.setdefault(group, []).append(k)

    def named(self, text: _Element, hulls: shapely.STRtree) -> int | None:
        """Return the shape that a text is bound to, grouped with alone, or lies over; or None."""
        container = text.data.get("containerId")
        if container:
            return self._by_id.get(container) if isinstance(container, str) else None
        for group in _groups(text):
            members = self._by_group.get(group, [])
            if len(members) == 1:
                return members[0]
        found = hulls.query(shapely.Point(_middle(text)), predicate="within")
        areas = {int(k): hulls.geometries[k].area for k in np.sort(found)}
        return min((k for k in areas if areas[k] > 0.0), key=areas.__getitem__, default=None)


def _groups(each: _Element) -> Sequence[str]:
    """Return the groups that an element is in, the innermost first."""
    groups = each.data.get("groupIds")
    return [group for group in groups if isinstance(group, str)] if isinstance(groups, list) else ()
