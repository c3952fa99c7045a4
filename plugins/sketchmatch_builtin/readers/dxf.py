"""Drawings in DXF."""

from __future__ import annotations

import io
import math
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
import shapely

from sketchmatch.api import InvalidInputError, Reader, Reason
from sketchmatch.api.documents import listed
from sketchmatch.model import FloatArray, Landmark, PolygonSet
from sketchmatch.model.arrays import frozen_floats
from sketchmatch.model.labels import cleaned_label
from sketchmatch.model.limits import check_vertices, source_limits

from ._areas import Areas, area_within, within_reach

__all__ = ["DxfReader"]

# Largest distance between a curve and its outline, as a share of the curve's larger side.
_TOLERANCE = 1e-3
# Points for each span of a spline.
_SPAN = 16
# Lines of a file that a vertex takes at least.
_LINES = 8
# Closed shapes for each allowed object after which counting stops: a hatch is none of its own.
_SHAPES_OF_OBJECT = 5
# A hatch is compared with so many shapes, those nearest in area.
_COMPARED = 20
# How deep blocks lie in blocks, and the islands of a hatch in islands.
_DEEPEST = 50
# From this share of its convex hull on a block is what its closed shapes cover.
_FILLED = 0.5
# Ends of lines within this share of all lines of the layer are one place.
_JOINED = 1e-5
# Texts that are farther apart than this share of the shape around them are of parts of it.
_ALL_OVER = 1 / 3
# Two areas that share this much are one, drawn as an outline and as a hatch.
_SAME = 0.95
_CLOSED = {"LWPOLYLINE", "POLYLINE", "CIRCLE", "ELLIPSE", "SPLINE"}
_HATCHES = {"HATCH", "MPOLYGON"}
_PIECES = {"LINE", "ARC"}
_LINES_OF_BLOCKS = {*_CLOSED, *_PIECES, "SOLID", "TRACE", "3DFACE"}
_TEXTS = {"TEXT", "MTEXT"}
_NAMING = ("NAME", "LABEL")
_BINARY = b"AutoCAD Binary DXF"


class _Shape(NamedTuple):
    """One area of the drawing, the name that it brings and how it was drawn."""

    area: Any
    name: str
    layer: str
    hatched: bool


class DxfReader(Reader):
    """Reads the closed shapes and the inserted blocks of a drawing, in metres.

    Closed polylines with their arcs, circles, ellipses, closed splines and hatches are objects, and
    so are lines, arcs and open curves of a layer that meet end to end all around an area, and each
    insert of a block: what its closed shapes cover, or the convex hull of all its lines where that
    is little. A hatch in an outline of its own is one object. What meets around nothing is a line,
    a wall to the segmenter ``rooms``, and texts are names of rooms to it. The model space is read,
    and in it the layers that are switched on, or those named as in ``plan.dxf#FURNITURE,DOORS``.
    The name of an object is the text in it, or else that of its block, or else of its layer; texts
    that are all over it name parts of it. Where the drawing says its unit (``$INSUNITS``), lengths
    become metres.

    Needs the package ezdxf: ``pip install 'sketchmatch[dxf]'``.

    References
    ----------
    Autodesk, "DXF Reference", 2012; M. Moitzi, "ezdxf", ezdxf.mozman.at.

    Examples
    --------
    A table of two metres by one, drawn in centimetres:

    >>> import io
    >>> import ezdxf
    >>> drawing, file = ezdxf.new(units=ezdxf.units.CM), io.StringIO()
    >>> corners = [(0, 0), (200, 0), (200, 100), (0, 100)]
    >>> _ = drawing.modelspace().add_lwpolyline(corners, close=True, dxfattribs={"layer": "table"})
    >>> drawing.write(file)
    >>> found = DxfReader().read(file.getvalue().encode())
    >>> found.polygons[0].label, found.polygons[0].rings[0].max(axis=0).tolist()
    ('table', [2.0, 1.0])
    """

    name = "dxf"
    summary = "Closed shapes and blocks of a DXF drawing; FILE#LAYER,… chooses layers."
    suffixes = (".dxf",)
    source = PolygonSet

    def read(self, data: bytes, part: str = "") -> PolygonSet:
        """Return the shapes as polygons, in metres."""
        with _refusing_damage():
            return _read(_drawing(data), part)


def _read(drawing: Any, part: str) -> PolygonSet:
    chosen = _layers(drawing, part)
    entities = [
        each
        for each in drawing.modelspace()
        if _key(each.dxf.get("layer", "0")) in chosen and not each.dxf.get("invisible", 0)
    ]
    left_out: Counter[str] = Counter()
    lines: list[FloatArray] = []
    most = _SHAPES_OF_OBJECT * source_limits().max_objects
    found = list(islice(_shapes(drawing, entities, left_out, lines), most + 1))
    if len(found) > most:
        raise _too_many(found, f"more than {most}")
    shapes = _without_doubles(found)
    corners = int(sum(shapely.get_num_coordinates(each.area) for each in shapes))
    check_vertices(corners + sum(map(len, lines)), "")
    _check_count(shapes)
    factor, notes = _metres(drawing)
    areas = Areas()
    texts = _texts(entities)
    names = _names(shapes, texts)
    for k, shape in enumerate(shapes):
        scaled = shapely.transform(shape.area, lambda points: points * factor)
        areas.add(scaled, names.get(k) or shape.name or _layer_name(shape.layer))
    for what, count in left_out.items():
        areas.leave_out(what, count)
    return replace(
        areas.polygon_set(*notes, *_note_on_layers(shapes, part), upwards=1.0),
        lines=tuple(frozen_floats(line * factor) for line in lines),
        landmarks=tuple(
            replace(
                each,
                point=(each.point[0] * factor, each.point[1] * factor),
                size=each.size * factor,
            )
            for each in texts
        ),
    )


def _drawing(data: bytes) -> Any:
    try:
        from ezdxf import recover
        from ezdxf.document import Drawing
        from ezdxf.lldxf.tagger import binary_tags_loader
    except ImportError:
        raise _invalid(
            "is a DXF drawing, which needs the package ezdxf; run pip install 'sketchmatch[dxf]'"
        ) from None
    lines = data.count(b"\n")
    check_vertices(lines // _LINES, "", f"has {lines} lines")
    if data.startswith(_BINARY):
        return Drawing.load(binary_tags_loader(data))
    return recover.read(io.BytesIO(data))[0]


@contextmanager
def _refusing_damage() -> Iterator[None]:
    """Refuse a damaged drawing, which makes the package raise whatever it stumbles over."""
    try:
        yield
    except InvalidInputError:
        raise
    except Exception as error:
        cause = cleaned_label(str(error))[:200].rstrip(".") or type(error).__name__
        raise _invalid(
            f"is not a DXF drawing, or is damaged ({cause}); save it as DXF again"
        ) from None


def _key(layer: str) -> str:
    """Return a layer's name as DXF compares it."""
    return layer.casefold()


def _layers(drawing: Any, part: str) -> set[str]:
    """Return which layers are read: those named, or else all that are switched on."""
    space = drawing.modelspace()
    known = {_key(layer.dxf.name): layer.dxf.name for layer in drawing.layers}
    known |= {_key(each.dxf.get("layer", "0")): each.dxf.get("layer", "0") for each in space}
    if not part:
        hidden = {
            _key(each.dxf.name) for each in drawing.layers if each.is_off() or each.is_frozen()
        }
        return set(known) - hidden
    wanted = {_key(name.strip()) for name in part.split(",")}
    missing = sorted(wanted - set(known))
    if missing:
        raise _invalid(
            f"has no layer {listed(missing)}; choose some of: {listed(sorted(known.values()))}"
        )
    return wanted


def _metres(drawing: Any) -> tuple[float, tuple[str, ...]]:
    """Return how many metres a unit of the drawing is, and what there is to say of it."""
    from ezdxf import units
    from ezdxf.enums import InsertUnits

    try:
        unit = InsertUnits(drawing.header.get("$INSUNITS", 0))
        return float(units.conversion_factor(unit, InsertUnits.Meters)), ()
    except (TypeError, ValueError, KeyError, IndexError):
        return 1.0, ("The drawing does not state its unit: lengths are taken as they are.",)


def _shapes(
    drawing: Any, entities: Iterable[Any], left_out: Counter[str], lines: list[FloatArray]
) -> Iterator[_Shape]:
    """Yield what encloses an area; count what is nothing, and add what is left of lines."""
    sizes = _Sizes(drawing)
    pieces: dict[str, list[FloatArray]] = {}
    for each in entities:
        kind, layer = each.dxftype(), each.dxf.get("layer", "0")
        if kind == "INSERT":
            sizes.check(each)
            for one in _single(each):
                area = _block_area(one)
                if area is None:
                    left_out["empty blocks"] += 1
                else:
                    yield _Shape(area, _block_name(each), layer, False)
        elif kind in _HATCHES or kind in _CLOSED or kind in _PIECES:
            points = np.empty((0, 2)) if kind in _HATCHES else _points(each)
            area = _area(each, points)
            if area is not None:
                yield _Shape(area, "", layer, kind in _HATCHES)
            elif not len(points):
                left_out["empty lines"] += 1
            else:
                pieces.setdefault(layer, []).append(points)
        elif kind not in _TEXTS:
            left_out[f"elements of type {kind[:40]}"] += 1
    for layer, open_ in pieces.items():
        loops, rest = _loops(open_)
        lines += rest
        yield from (_Shape(area, "", layer, False) for area in loops)


def _loops(lines: list[FloatArray]) -> tuple[list[Any], list[FloatArray]]:
    """Return the areas around which lines go end to end, and what the others make."""
    lines = [within_reach(line) for line in lines]
    grid = _JOINED * float(np.ptp(np.concatenate(lines), axis=0).max())
    # Only ends that are equal are joined.
    met = [np.concatenate([line[:1], line[-1:]]) for line in lines]
    ends = np.round(np.array(met) / grid) * grid
    chains = shapely.line_merge(
        shapely.MultiLineString(
            [
                np.concatenate([end[:1], line[1:-1], end[1:]])
                for line, end in zip(lines, ends, strict=True)
            ]
        )
    )
    parts = shapely.get_parts(chains)
    loops, rest = [], []
    for part in parts:
        points = shapely.get_coordinates(part)
        area = area_within(points) if part.is_closed else shapely.Polygon()
        if area.area > 0.0:
            loops.append(area)
        else:
            rest.append(points)
    return loops, rest


def _single(insert: Any) -> Iterator[Any]:
    """Yield the inserts of a grid one by one."""
    return iter(insert.multi_insert()) if insert.mcount > 1 else iter([insert])


class _Sizes:
    """How many elements inserts unfold to, so that none is unfolded beyond the limit."""

    def __init__(self, drawing: Any) -> None:
        self._blocks = drawing.blocks
        self._known: dict[str, int] = {}
        self._total = 0

    def check(self, insert: Any) -> None:
        self._total += self._of(insert, 0)
        limit = source_limits().max_elements
        if self._total > limit:
            raise InvalidInputError(
                Reason.LIMIT_EXCEEDED,
                "",
                f"unfolds to more than the limit of {limit} elements, a tenth of that of vertices; "
                "choose layers, or raise limits.max_vertices (SKETCHMATCH_LIMITS__MAX_VERTICES)",
            )

    def _of(self, insert: Any, depth: int) -> int:
        if depth > _DEEPEST:
            raise _invalid(f"has blocks nested more than {_DEEPEST} deep; explode some")
        name = insert.dxf.get("name", "")
        if name not in self._known:
            block = self._blocks.get(name)
            self._known[name] = sum(
                self._of(each, depth + 1) if each.dxftype() == "INSERT" else 1
                for each in (() if block is None else block)
            )
        return int(max(1, insert.mcount)) * (1 + self._known[name])


def _block_name(insert: Any) -> str:
    """Return what an attribute says that is a name, or else the block's name."""
    for attribute in insert.attribs:
        tag = str(attribute.dxf.get("tag", "")).upper()
        if any(word in tag for word in _NAMING) and attribute.dxf.get("text", ""):
            return str(attribute.dxf.text)
    name = str(insert.dxf.get("name", ""))
    return "" if name.startswith("*") else name


def _block_area(insert: Any) -> Any | None:
    """Return what a block covers; None if nothing is drawn in it."""
    from ezdxf.disassemble import recursive_decompose

    closed, points = [], []
    for each in islice(recursive_decompose([insert]), source_limits().max_elements):
        kind = each.dxftype()
        if kind in _HATCHES or kind in _LINES_OF_BLOCKS:
            points.append(_points(each))
            area = _area(each, points[-1])
            if area is not None:
                closed.append(area)
    drawn = np.concatenate(points) if points else np.empty((0, 2))
    hull = shapely.MultiPoint(within_reach(drawn)).convex_hull
    if hull.area <= 0.0:
        return None
    covered = shapely.union_all([shapely.Polygon(part.exterior) for part in _polygons(closed)])
    parts = [part for part in shapely.get_parts(covered) if part.area >= _FILLED * hull.area]
    return parts[0] if parts else hull


def _polygons(areas: Iterable[Any]) -> Iterator[shapely.Polygon]:
    for area in areas:
        yield from (part for part in shapely.get_parts(area) if part.geom_type == "Polygon")


def _area(each: Any, points: FloatArray) -> Any | None:
    """Return the area of an element, of which these are the points; None if it has none."""
    if each.dxftype() in _HATCHES:
        area = _alternating([area_within(points) for points in _paths(each)])
        return area if area.area > 0.0 else None
    if len(points) < 3 or not _is_closed(each, points):
        return None
    area = area_within(points)
    return area if area.area > 0.0 else None


def _alternating(areas: list[Any]) -> Any:
    """Return what lies within an odd number of nested areas, as a hatch has its islands."""
    tree = shapely.STRtree(areas)
    depths = []
    for area in areas:
        around = tree.query(area, predicate="within") if area.area > 0.0 else ()
        if len(around) > _DEEPEST:
            raise _invalid(
                f"has a hatch with islands nested more than {_DEEPEST} deep; draw it again"
            )
        depths.append(sum(areas[j].area > area.area for j in around))
    covered: Any = shapely.Polygon()
    for depth in sorted(set(depths)):
        level = [area for area, d in zip(areas, depths, strict=True) if d == depth]
        together = shapely.union_all(level)
        covered = covered.difference(together) if depth % 2 else covered.union(together)
    return covered


def _is_closed(each: Any, points: FloatArray) -> bool:
    if each.dxftype() in ("LWPOLYLINE", "SPLINE") and each.closed:
        return True
    if each.dxftype() == "POLYLINE" and each.is_closed:
        return True
    extent = float(np.ptp(points, axis=0).max())
    return bool(np.abs(points[0] - points[-1]).max() <= 1e-6 * extent)


def _points(each: Any) -> FloatArray:
    """Return points along an element, seen from above."""
    paths = list(_paths(each))
    return np.concatenate(paths) if paths else np.empty((0, 2))


def _paths(each: Any) -> Iterator[FloatArray]:
    from ezdxf import path

    try:
        if each.dxftype() == "SPLINE":
            yield _spline(each)
            return
        if each.dxftype() in _HATCHES:
            found = list(path.from_hatch(each))
        else:
            found = [path.make_path(each)]
        for one in found:
            control = np.array([(v.x, v.y) for v in one.control_vertices()]).reshape(-1, 2)
            if len(control) < 2 or not np.isfinite(control).all():
                continue
            extent = float(np.ptp(control, axis=0).max())
            if extent > 0.0:
                curve = islice(one.flattening(_TOLERANCE * extent), source_limits().max_vertices)
                yield np.array([(v.x, v.y) for v in curve])
    except InvalidInputError:
        raise
    except Exception:  # what is no path, or a broken one, has no points
        return


def _spline(each: Any) -> FloatArray:
    """Return points of a spline within its domain: a closed one's goes not to its outer knots."""
    curve = each.construction_tool()
    knots, degree = curve.knots(), curve.degree
    spans = curve.count - degree
    check_vertices(_SPAN * spans, "")
    places = np.linspace(knots[degree], knots[-degree - 1], _SPAN * spans + 1)
    return np.array([(v.x, v.y) for v in curve.points(places)])


def _without_doubles(shapes: list[_Shape]) -> list[_Shape]:
    """Leave out hatches that fill the outline of something else, or each other."""
    kept: list[_Shape] = [shape for shape in shapes if not shape.hatched]
    tree = shapely.STRtree([shape.area for shape in shapes])
    order = {id(shape): k for k, shape in enumerate(shapes)}
    for k, shape in enumerate(shapes):
        if shape.hatched:
            others = (shapes[j] for j in tree.query(shape.area).tolist() if j != k)
            earlier = [o for o in others if not o.hatched or order[id(o)] < k]
            earlier.sort(key=lambda other: abs(other.area.area - shape.area.area))
            if not any(_same(shape.area, other.area) for other in earlier[:_COMPARED]):
                kept.append(shape)
    return sorted(kept, key=lambda shape: order[id(shape)])


def _same(one: Any, other: Any) -> bool:
    outlines = [
        shapely.union_all([shapely.Polygon(p.exterior) for p in _polygons([a])])
        for a in (one, other)
    ]
    shared = outlines[0].intersection(outlines[1]).area
    return bool(shared >= _SAME * outlines[0].union(outlines[1]).area)


def _texts(entities: Iterable[Any]) -> list[Landmark]:
    """Return what is written, and where, in the drawing's unit."""
    found = []
    for each in entities:
        if each.dxftype() in _TEXTS and each.dxf.get("insert") is not None:
            x, y = float(each.dxf.insert.x), float(each.dxf.insert.y)
            words = cleaned_label(each.plain_text())
            if words and max(abs(x), abs(y)) < math.inf:
                height = "char_height" if each.dxftype() == "MTEXT" else "height"
                size = float(each.dxf.get(height, 0.0))
                found.append(Landmark(words, (x, y), "room", size))
    return found


def _names(shapes: list[_Shape], texts: list[Landmark]) -> dict[int, str]:
    """Return the names of shapes: the texts in each, and in no smaller one, unless all over it."""
    places = np.array([text.point for text in texts]).reshape(-1, 2)
    left = np.arange(len(texts))
    names: dict[int, str] = {}
    for k in sorted(range(len(shapes)), key=lambda k: float(shapes[k].area.area)):
        area = shapes[k].area
        shapely.prepare(area)
        inside = left[shapely.contains_xy(area, places[left])]
        if not len(inside):
            continue
        left = np.setdiff1d(left, inside)
        x0, y0, x1, y1 = area.bounds
        if (np.ptp(places[inside], axis=0) <= _ALL_OVER * np.array([x1 - x0, y1 - y0])).all():
            names[k] = " ".join(texts[i].name for i in inside)
    return names


def _layer_name(layer: str) -> str:
    return "" if layer == "0" else layer


def _note_on_layers(shapes: list[_Shape], part: str) -> Iterator[str]:
    if not part and len({shape.layer for shape in shapes}) > 1:
        yield (
            "The objects are on several layers, of which FILE#LAYER,… chooses some: "
            f"{_counted(shapes)}."
        )


def _counted(shapes: list[_Shape]) -> str:
    """Return the layers of shapes, each with how many there are, as far as there is room."""
    counts = Counter(shape.layer for shape in shapes)
    return ", ".join(f"{cleaned_label(layer)} ({n})" for layer, n in counts.most_common(12))


def _check_count(shapes: list[_Shape]) -> None:
    limit = source_limits().max_objects
    if len(shapes) > limit:
        raise _too_many(shapes, str(len(shapes)))


def _too_many(shapes: list[_Shape], count: str) -> InvalidInputError:
    return InvalidInputError(
        Reason.LIMIT_EXCEEDED,
        "",
        f"has {count} closed shapes, more than the limit of {source_limits().max_objects} objects; "
        f"choose layers as in FILE#LAYER,… ({_counted(shapes)}), or raise limits.max_objects "
        "(SKETCHMATCH_LIMITS__MAX_OBJECTS)",
    )


def _invalid(problem: str) -> InvalidInputError:
    return InvalidInputError(Reason.INVALID_FILE, "", problem)
