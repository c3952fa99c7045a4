"""Annotations of labelme."""

from __future__ import annotations

import base64
import binascii
from io import BytesIO
from typing import Any

import numpy as np
import shapely

from sketchmatch.api import InvalidInputError, Reader, Reason
from sketchmatch.api.documents import (
    decode_text,
    load_json,
    mapping,
    no_parts,
    number,
    plain_name,
    sequence,
    shown,
)
from sketchmatch.model import FloatArray, IntArray, PolygonSet

from ._areas import Areas, area_within, box, check_elements, ellipse, within_reach

__all__ = ["LabelmeReader"]

_POLYGON = Reason.INVALID_POLYGON
_IGNORED = "__ignore__"
_NO_AREA = {
    "point": "points",
    "points": "points",
    "line": "lines",
    "linestrip": "lines",
    "linestring": "lines",
}


class LabelmeReader(Reader):
    """Reads what labelme, or one of the tools that write its format, drew on a picture.

    Polygons, rectangles, circles, turned rectangles and masks are objects with their labels, in
    pixels; those of one label and one ``group_id`` are parts of one object. Points and lines are
    left out with a note, and so is what is labelled ``__ignore__``.

    References
    ----------
    K. Wada, "labelme: Image Polygonal Annotation with Python", github.com/wkentaro/labelme.

    Examples
    --------
    >>> square = '{"label": "desk", "shape_type": "rectangle", "points": [[0, 0], [4, 2]]}'
    >>> found = LabelmeReader().read(f'{{"shapes": [{square}]}}'.encode())
    >>> found.polygons[0].label, found.polygons[0].rings[0].min(axis=0).tolist()
    ('desk', [0.0, -2.0])
    """

    name = "labelme"
    summary = "Shapes drawn on a picture with labelme."
    keys = ("shapes",)
    source = PolygonSet

    def read(self, data: bytes, part: str = "") -> PolygonSet:
        """Return the shapes as polygons, in pixels, y upwards."""
        no_parts(part)
        document = mapping(load_json(decode_text(data)), "", _POLYGON, "an object with shapes")
        shapes = sequence(document.get("shapes"), "shapes", _POLYGON, "a list of shapes")
        check_elements(len(shapes), "shapes", "shapes")
        areas = Areas()
        objects: dict[tuple[str, str], list[Any]] = {}
        for k, each in enumerate(shapes):
            field = f"shapes[{k}]"
            shape = mapping(each, field, _POLYGON, "a shape")
            label, group = plain_name(shape.get("label")), plain_name(shape.get("group_id"))
            area = _area(areas, shape, field)
            if label == _IGNORED:
                areas.leave_out(f"shapes labelled {_IGNORED}")
            elif area is not None:
                # A shape without group is an object of its own.
                objects.setdefault((label, f"group {group}" if group else field), []).append(area)
        for (label, _), parts in objects.items():
            areas.add(parts[0] if len(parts) == 1 else shapely.union_all(parts), label)
        return areas.polygon_set()


def _area(areas: Areas, shape: dict[str, Any], field: str) -> Any | None:
    """Return the area of a shape; None, and counted as left out, where it is of a kind without."""
    kind = shape.get("shape_type") or "polygon"
    points = _points(shape.get("points"), f"{field}.points")
    match kind:
        case "polygon" | "rotation" | "oriented_rectangle":
            return area_within(points)
        case "rectangle" if len(points) >= 2:
            return area_within(box(*points.min(axis=0), *points.max(axis=0)))
        case "circle" if len(points) == 2:
            radius = float(np.hypot(*(points[1] - points[0])))
            x, y = points[0]
            return area_within(ellipse(x, y, radius, radius))
        case "mask" if len(points) == 2:
            at = f"{field}.mask"
            runs = _mask(areas, shape.get("mask"), points[0], at)
            return areas.of_runs(runs, at, columns=False)
        case "rectangle" | "circle" | "mask":
            raise InvalidInputError(
                _POLYGON,
                f"{field}.points",
                f"is a list of {len(points)}; give two points for a {kind}",
            )
        case _ if isinstance(kind, str) and kind in _NO_AREA:
            areas.leave_out(_NO_AREA[kind])
            return None
        case _:
            raise InvalidInputError(
                _POLYGON,
                f"{field}.shape_type",
                f"is {shown(kind)}, which is not known; give polygon, rectangle, circle or mask",
            )


def _points(value: Any, field: str) -> FloatArray:
    points = sequence(value, field, _POLYGON, "a list of [x, y]")
    rows = []
    for k, point in enumerate(points):
        pair = sequence(point, f"{field}[{k}]", _POLYGON, "[x, y]")
        if len(pair) < 2:
            raise InvalidInputError(_POLYGON, f"{field}[{k}]", f"is {shown(pair)}; give [x, y]")
        rows.append([number(pair[i], f"{field}[{k}][{i}]", _POLYGON) for i in (0, 1)])
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def _mask(areas: Areas, value: Any, corner: FloatArray, field: str) -> IntArray:
    """Return the runs of a mask, a picture in base64 whose first pixel lies at a corner."""
    x, y = np.floor(within_reach(corner)[0]).astype(np.int64)
    padded = np.pad(_pixels(areas, value, field), ((0, 0), (1, 1))).astype(np.int8)
    steps = np.diff(padded, axis=1)
    rows, begins = np.nonzero(steps == 1)
    _, ends = np.nonzero(steps == -1)
    return np.column_stack([rows + y, begins + x, ends + x])


def _pixels(areas: Areas, value: Any, field: str) -> Any:
    from PIL import Image as Picture

    problem = "is not a picture in base64; save the file with labelme again"
    if not isinstance(value, str):
        raise InvalidInputError(_POLYGON, field, f"is {shown(value)}; give a picture in base64")
    try:
        with Picture.open(BytesIO(base64.b64decode(value)), formats=["PNG"]) as picture:
            areas.check_pixels(*picture.size, field)
            return np.asarray(picture.convert("L")) > 0
    except InvalidInputError:
        raise
    except (OSError, ValueError, SyntaxError, binascii.Error, Picture.DecompressionBombError):
        raise InvalidInputError(_POLYGON, field, problem) from None
