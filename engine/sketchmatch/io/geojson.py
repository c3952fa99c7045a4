"""Polygons as GeoJSON (RFC 7946), read as plain coordinates: x right, y up, in any one unit.

A ``FeatureCollection``, ``Feature``, ``GeometryCollection``, ``Polygon`` or ``MultiPolygon``; each
polygon becomes one object. A feature's property ``label``, or else ``name``, is its label. Heights
(a third coordinate) are ignored, and rings need not repeat their first point.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io._fields import load_json, mapping, number, sequence, shown
from sketchmatch.model import FloatArray, LabelledPolygon, PolygonSet
from sketchmatch.model.arrays import frozen_floats

__all__ = ["decode_geojson"]

_POLYGON = Reason.INVALID_POLYGON


def decode_geojson(text: str) -> PolygonSet:
    """Decode the polygons of a GeoJSON text.

    Raises
    ------
    InvalidInputError
        With a path such as ``features[3].geometry.coordinates[0][2]``, if the text is not
        GeoJSON or has geometry other than polygons.

    Examples
    --------
    >>> square = '{"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1], [0, 0]]]}'
    >>> decode_geojson(square).polygons[0].rings[0].shape
    (4, 2)
    """
    try:
        return PolygonSet(tuple(_polygons(load_json(text), "", "")))
    except RecursionError:
        raise InvalidInputError(
            _POLYGON, "", "is nested too deeply; give its polygons as features"
        ) from None


def _polygons(value: Any, field: str, label: str) -> Iterator[LabelledPolygon]:
    """Yield the polygons of any GeoJSON object; ``field`` is its path."""
    item = mapping(value, field, _POLYGON, "a GeoJSON object")
    match item.get("type"):
        case "FeatureCollection":
            yield from _members(item, field, "features", label)
        case "GeometryCollection":
            yield from _members(item, field, "geometries", label)
        case "Feature":
            yield from _polygons(item.get("geometry"), _path(field, "geometry"), _label(item))
        case "Polygon":
            yield _polygon(item.get("coordinates"), _path(field, "coordinates"), label)
        case "MultiPolygon":
            at = _path(field, "coordinates")
            for k, part in enumerate(sequence(item.get("coordinates"), at, _POLYGON, "polygons")):
                yield _polygon(part, f"{at}[{k}]", label)
        case other:
            raise InvalidInputError(
                _POLYGON,
                _path(field, "type"),
                f"is {shown(other)}; give Polygon or MultiPolygon, alone or in features",
            )


def _members(item: dict[str, Any], field: str, key: str, label: str) -> Iterator[LabelledPolygon]:
    at = _path(field, key)
    for k, member in enumerate(sequence(item.get(key), at, _POLYGON, f"a list of {key}")):
        yield from _polygons(member, f"{at}[{k}]", label)


def _label(feature: dict[str, Any]) -> str:
    properties = feature.get("properties")
    if not isinstance(properties, dict):
        return ""
    names = (properties.get(key) for key in ("label", "name"))
    return next((str(name) for name in names if isinstance(name, str | int | float) and name), "")


def _polygon(value: Any, field: str, label: str) -> LabelledPolygon:
    rings = sequence(value, field, _POLYGON, "a list of rings")
    return LabelledPolygon(
        tuple(_ring(ring, f"{field}[{k}]") for k, ring in enumerate(rings)), label
    )


def _ring(value: Any, field: str) -> FloatArray:
    positions = sequence(value, field, _POLYGON, "a list of [x, y] positions")
    rows = [_position(position, f"{field}[{k}]") for k, position in enumerate(positions)]
    return frozen_floats(np.array(rows, dtype=np.float64).reshape(-1, 2))


def _position(value: Any, field: str) -> list[float]:
    position = sequence(value, field, _POLYGON, "a position [x, y]")
    if len(position) < 2:
        raise InvalidInputError(_POLYGON, field, f"is {shown(position)}; give a position [x, y]")
    return [number(position[i], f"{field}[{i}]", _POLYGON) for i in (0, 1)]


def _path(field: str, key: str) -> str:
    return f"{field}.{key}" if field else key
