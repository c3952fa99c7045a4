"""Annotations in the format of COCO."""

from __future__ import annotations

from typing import Any

import shapely

from sketchmatch.api import InvalidInputError, Reader, Reason
from sketchmatch.api.documents import (
    decode_text,
    load_json,
    mapping,
    number,
    plain_name,
    sequence,
    shown,
)
from sketchmatch.model import IntArray, PolygonSet
from sketchmatch.model.limits import check_pixels

from ._areas import Areas, area_within, box, check_elements, unfolded
from ._pictures import chosen_picture

__all__ = ["CocoReader"]

_POLYGON = Reason.INVALID_POLYGON


class CocoReader(Reader):
    """Reads the objects of one picture in a file of annotations as COCO has them.

    Each annotation is an object with the name of its category: the union of its polygons, or its
    run-length encoded mask, compressed or not, or else its bounding box. A file with annotations of
    several pictures wants one chosen by name or id, as in ``instances.json#room.jpg``.

    References
    ----------
    T.-Y. Lin et al., "Microsoft COCO: Common Objects in Context", ECCV, 2014.

    Examples
    --------
    >>> found = CocoReader().read(
    ...     b'{"images": [{"id": 1, "file_name": "a.jpg"}],'
    ...     b'"categories": [{"id": 3, "name": "bed"}],'
    ...     b'"annotations": [{"image_id": 1, "category_id": 3, "bbox": [0, 0, 4, 2]}]}'
    ... )
    >>> found.polygons[0].label
    'bed'
    """

    name = "coco"
    summary = "Objects of one picture in COCO annotations; FILE#PICTURE chooses it."
    keys = ("images", "annotations")
    source = PolygonSet

    def read(self, data: bytes, part: str = "") -> PolygonSet:
        """Return the annotations of a picture as polygons, in pixels, y upwards."""
        document = mapping(load_json(decode_text(data)), "", _POLYGON, "an object")
        pictures = {
            plain_name(image.get("id")): plain_name(image.get("file_name"))
            for image in _items(document, "images")
        }
        names = {
            plain_name(category.get("id")): plain_name(category.get("name"))
            for category in _items(document, "categories")
        }
        by_picture: dict[str, list[tuple[int, dict[str, Any]]]] = {}
        for k, annotation in enumerate(_items(document, "annotations")):
            by_picture.setdefault(plain_name(annotation.get("image_id")), []).append(
                (k, annotation)
            )
        wanted = chosen_picture(
            {key: pictures.get(key, "") for key in (*pictures, *by_picture)}, by_picture, part
        )
        chosen = by_picture.get(wanted, [])
        check_elements(sum(_parts(annotation) for _, annotation in chosen), "", "shapes")
        areas = Areas()
        for k, annotation in chosen:
            name, field = (
                names.get(plain_name(annotation.get("category_id")), ""),
                f"annotations[{k}]",
            )
            mask = annotation.get("segmentation")
            if isinstance(mask, dict):
                at = f"{field}.segmentation"
                areas.add(areas.of_runs(_mask(mask, at), at, columns=True), name)
            else:
                areas.add(_area(annotation, field), name)
        return areas.polygon_set()


def _items(document: dict[str, Any], key: str) -> list[dict[str, Any]]:
    items = sequence(document.get(key, []), key, _POLYGON, f"a list of {key}")
    return [mapping(item, f"{key}[{k}]", _POLYGON, "an object") for k, item in enumerate(items)]


def _parts(annotation: dict[str, Any]) -> int:
    parts = annotation.get("segmentation")
    return max(1, len(parts)) if isinstance(parts, list) else 1


def _area(annotation: dict[str, Any], field: str) -> Any:
    """Return the area of an annotation: of its polygons, or else of its box."""
    segmentation = annotation.get("segmentation")
    if segmentation:
        parts = sequence(segmentation, f"{field}.segmentation", _POLYGON, "polygons")
        areas = [_ring(part, f"{field}.segmentation[{k}]") for k, part in enumerate(parts)]
        return shapely.union_all(areas)
    at = f"{field}.bbox"
    values = sequence(annotation.get("bbox"), at, _POLYGON, "[x, y, width, height]")
    if len(values) != 4:
        raise InvalidInputError(_POLYGON, at, f"is {shown(values)}; give [x, y, width, height]")
    x, y, width, height = (number(v, f"{at}[{i}]", _POLYGON) for i, v in enumerate(values))
    return area_within(box(x, y, x + width, y + height))


def _ring(value: Any, field: str) -> Any:
    flat = sequence(value, field, _POLYGON, "a polygon [x1, y1, x2, y2, …]")
    if len(flat) % 2:
        raise InvalidInputError(
            _POLYGON, field, f"has {len(flat)} numbers; give an x and a y for each corner"
        )
    return area_within([number(v, f"{field}[{i}]", _POLYGON) for i, v in enumerate(flat)])


def _mask(value: dict[str, Any], field: str) -> IntArray:
    """Return the runs of a mask, given as lengths of runs down the columns, from the left."""
    size = sequence(value.get("size"), f"{field}.size", _POLYGON, "[height, width]")
    sides = [int(number(v, f"{field}.size", _POLYGON)) for v in size]
    if len(sides) != 2 or min(sides) < 1:
        raise InvalidInputError(
            _POLYGON, f"{field}.size", f"is {shown(size)}; give [height, width]"
        )
    height, width = sides
    check_pixels(width, height, f"{field}.size")
    counts = _counts(value.get("counts"), f"{field}.counts")
    if sum(counts) != height * width or min(counts) < 0:
        raise InvalidInputError(
            _POLYGON,
            f"{field}.counts",
            f"are of {sum(counts)} pixels, but the picture has {height * width}; save it again",
        )
    return unfolded(counts, height)


def _counts(value: Any, field: str) -> list[int]:
    if isinstance(value, str):
        return _uncompressed(value, field)
    counts = sequence(value, field, _POLYGON, "the lengths of runs")
    return [int(number(v, f"{field}[{i}]", _POLYGON)) for i, v in enumerate(counts)] or [0]


def _uncompressed(text: str, field: str) -> list[int]:
    """Return the lengths in a string of COCO: 5 bits a character, differences from the third on."""
    counts: list[int] = []
    value = shift = 0
    for character in text:
        bits = ord(character) - 48
        if not 0 <= bits < 64 or shift > 30:
            raise InvalidInputError(
                _POLYGON, field, "is not a run-length encoding of COCO; save it again"
            )
        value |= (bits & 0x1F) << shift
        shift += 5
        if bits & 0x20:
            continue
        if bits & 0x10:
            value -= 1 << shift
        counts.append(value + (counts[-2] if len(counts) > 2 else 0))
        value = shift = 0
    return counts or [0]
