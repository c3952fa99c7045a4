"""Annotations of CVAT, as its own XML."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from sketchmatch.api import InvalidInputError, Reader, Reason
from sketchmatch.api.documents import load_xml, shown
from sketchmatch.model import IntArray, PolygonSet
from sketchmatch.model.limits import check_pixels

from ._areas import Areas, area_within, box, check_elements, ellipse, unfolded, within_reach
from ._pictures import chosen_picture

__all__ = ["CvatReader"]

_POLYGON = Reason.INVALID_POLYGON
_NO_AREA = {
    "polyline": "lines",
    "points": "points",
    "skeleton": "skeletons",
    "cuboid": "cuboids",
    "tag": "tags",
}
_SHAPES = {"polygon", "box", "ellipse", "mask", *_NO_AREA}


class _Shape(NamedTuple):
    element: ElementTree.Element
    label: str
    field: str


class CvatReader(Reader):
    """Reads the objects of one picture, or of one frame of a film, from the XML of CVAT.

    Polygons, boxes, ellipses and masks are objects with their labels, in pixels; lines and points
    are left out with a note. Where several pictures or frames have objects, one is chosen by name,
    id or number, as in ``annotations.xml#room.jpg``.

    References
    ----------
    CVAT.ai Corporation, "CVAT for images" and "CVAT for videos", XML format 1.1, docs.cvat.ai.

    Examples
    --------
    >>> found = CvatReader().read(
    ...     b'<annotations><image id="0" name="a.jpg"><box label="bed" xtl="0" ytl="0" xbr="4"'
    ...     b' ybr="2"/></image></annotations>'
    ... )
    >>> found.polygons[0].label
    'bed'
    """

    name = "cvat"
    summary = "Objects of one picture in CVAT annotations; FILE#PICTURE chooses it."
    suffixes = (".xml",)
    source = PolygonSet

    def read(self, data: bytes, part: str = "") -> PolygonSet:
        """Return the annotations of a picture as polygons, in pixels, y upwards."""
        root = load_xml(data)
        if root.tag != "annotations":
            raise InvalidInputError(
                Reason.INVALID_FILE,
                "",
                f"is XML but not from CVAT: it begins with <{root.tag[:60]}>; export it as "
                "'CVAT for images'",
            )
        names: dict[str, str] = {}
        shapes: dict[str, list[_Shape]] = {}
        for key, name, shape in _shapes(root):
            names[key] = name
            if shape is not None:
                shapes.setdefault(key, []).append(shape)
        chosen = shapes.get(chosen_picture(names, shapes, part), [])
        check_elements(len(chosen), "", "shapes")
        areas = Areas()
        for shape in chosen:
            _add(areas, shape)
        return areas.polygon_set()


def _shapes(root: ElementTree.Element) -> Iterator[tuple[str, str, _Shape | None]]:
    """Yield the id and name of pictures and frames, each with its shapes one by one."""
    for k, image in enumerate(root.iter("image")):
        key = image.get("id", f"image {k}")
        yield key, image.get("name", ""), None
        for i, element in enumerate(child for child in image if child.tag in _SHAPES):
            yield (
                key,
                image.get("name", ""),
                _Shape(element, element.get("label", ""), f"image[{k}].shape[{i}]"),
            )
    for k, track in enumerate(root.iter("track")):
        for i, element in enumerate(child for child in track if child.tag in _SHAPES):
            if element.get("outside") != "1":
                frame = element.get("frame", "0")
                yield (
                    frame,
                    frame,
                    _Shape(element, track.get("label", ""), f"track[{k}].shape[{i}]"),
                )


def _add(areas: Areas, shape: _Shape) -> None:
    element, label, field = shape
    match element.tag:
        case "polygon":
            text = element.get("points", "")
            pairs = [_numbers(pair, f"{field}.points", 2) for pair in text.split(";") if pair]
            areas.add(area_within(pairs), label)
        case "box":
            x0, y0, x1, y1 = (_number(shape, key) for key in ("xtl", "ytl", "xbr", "ybr"))
            turn = math.radians(_number(shape, "rotation", "0"))
            areas.add(area_within(box(x0, y0, x1, y1, turn)), label)
        case "ellipse":
            x, y, rx, ry = (_number(shape, key) for key in ("cx", "cy", "rx", "ry"))
            turn = math.radians(_number(shape, "rotation", "0"))
            areas.add(area_within(ellipse(x, y, rx, ry, turn)), label)
        case "mask":
            areas.add(areas.of_runs(_mask(shape), f"{field}.rle", columns=False), label)
        case _:
            areas.leave_out(_NO_AREA[element.tag])


def _mask(shape: _Shape) -> IntArray:
    """Return the runs of a mask: their lengths along the rows of its window, the first unset."""
    left, top, width, height = (
        int(_number(shape, key)) for key in ("left", "top", "width", "height")
    )
    field = f"{shape.field}.rle"
    counts = [int(c) for c in _numbers(shape.element.get("rle", ""), field)]
    if width < 1 or height < 1 or min(counts, default=0) < 0 or sum(counts) != width * height:
        raise InvalidInputError(
            _POLYGON,
            field,
            f"is of {sum(counts)} pixels for {width} × {height}; export it from CVAT again",
        )
    check_pixels(width, height, field)
    within_reach([[left, top]])
    placed: IntArray = unfolded(counts, width) + np.array([top, left, left])
    return placed


def _number(shape: _Shape, key: str, otherwise: str = "") -> float:
    return _numbers(shape.element.get(key, otherwise), f"{shape.field}.{key}", 1)[0]


def _numbers(text: str, field: str, count: int = 0) -> list[float]:
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if not values or (count and len(values) != count) or not all(map(math.isfinite, values)):
        expected = "numbers" if count != 1 else "a number"
        raise InvalidInputError(_POLYGON, field, f"is {shown(text)}; give {expected}")
    return values
