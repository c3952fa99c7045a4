"""Polygons as GeoJSON (RFC 7946), read as plain coordinates: x right, y up, in any one unit.

A ``FeatureCollection``, ``Feature``, ``GeometryCollection``, ``Polygon`` or ``MultiPolygon``, or
several of them in a list, in a line each, or as a text sequence (RFC 8142); each polygon becomes
one object. A feature's property ``label``, or else ``name``, ``alt_name`` or ``ref``, however it is
capitalized, or else its ``id``, is its label; a name in several languages, as IMDF has them, is the
first of them. Its property
``certainty``, above 0 and up to 1, is how sure it is that it is one thing. Of a building of several
levels, which features name in ``level_id`` or ``level``, ``plan.geojson#1`` chooses one.
Heights (a third coordinate) are ignored, and rings need not repeat their first point.

A feature whose geometry is null or empty has no place; points and lines are no areas. Both are left
out with a note. A closed line of four or more positions is what the RFC calls a linear ring, and
taken as an outline, with a note.

Longitudes and latitudes become metres east and north of their middle, with a note: the polygons are
taken for such where a member ``crs`` says so, or where they lie within a tenth of a degree, as no
place in metres does. ``"crs": null``, as in what we write, says that they are not.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from sketchmatch.api.documents import (
    check_values,
    listed,
    load_json,
    mapping,
    no_parts,
    number,
    plain_name,
    sequence,
    shown,
)
from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.io.degrees import SPAN, in_metres, may_be_degrees, middle_of, names_degrees
from sketchmatch.model import FloatArray, LabelledPolygon, PolygonSet
from sketchmatch.model.arrays import frozen_floats
from sketchmatch.model.labels import cleaned_label

__all__ = ["TURNED", "decode_geojson", "is_geojson", "load_sequence", "polygons_of"]

TURNED = "The coordinates are longitudes and latitudes, and were turned into metres."

_POLYGON = Reason.INVALID_POLYGON
_GEOMETRIES = {
    "Polygon": "",
    "MultiPolygon": "",
    "GeometryCollection": "",
    "Point": "points",
    "MultiPoint": "points",
    "LineString": "open lines",
    "MultiLineString": "lines",
}
_TYPES = {*_GEOMETRIES, "Feature", "FeatureCollection"}
_RECORD_SEPARATOR = "\x1e"
_MOST_LEVELS = 12


@dataclass(frozen=True)
class _Reading:
    """What is read, and what there is to say of it."""

    level: str
    remarks: list[tuple[str, str]] = field(default_factory=list)
    levels: Counter[str] = field(default_factory=Counter)


def decode_geojson(text: str) -> PolygonSet:
    """Decode the polygons of a GeoJSON text.

    Raises
    ------
    InvalidInputError
        With a path such as ``features[3].geometry.coordinates[0][2]``, if the text is not
        GeoJSON.

    Examples
    --------
    >>> square = '{"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1], [0, 0]]]}'
    >>> decode_geojson(square).polygons[0].rings[0].shape
    (4, 2)
    """
    return polygons_of(load_sequence(text))


def load_sequence(text: str) -> Any:
    """Parse a JSON text, or several, one in a line or after a record separator, as a list.

    Raises
    ------
    InvalidInputError
        If it is not JSON.
    """
    check_values(text)
    if text.startswith(_RECORD_SEPARATOR):
        return _all_of(text.split(_RECORD_SEPARATOR))
    first, _, others = text.lstrip().partition("\n")
    return _all_of(text.split("\n")) if others.strip() and _is_json(first) else load_json(text)


def _all_of(texts: Iterable[str]) -> list[Any]:
    documents: list[Any] = []
    for each in filter(str.strip, texts):
        try:
            documents.append(load_json(each))
        except InvalidInputError as error:
            raise error.within(f"[{len(documents)}]") from None
    return documents


def is_geojson(document: Any) -> bool:
    """Whether a parsed JSON document says that it is GeoJSON, or a list of such."""
    if isinstance(document, list):
        return bool(document) and all(map(is_geojson, document))
    kind = document.get("type") if isinstance(document, dict) else None
    return isinstance(kind, str) and kind in _TYPES


def polygons_of(document: Any, level: str = "") -> PolygonSet:
    """Return the polygons of a parsed document, as :func:`decode_geojson` does, or of one level."""
    reading = _Reading(level)
    members = document if isinstance(document, list) and document else [document]
    paths = [f"[{k}]" for k in range(len(members))] if members is document else [""]
    try:
        polygons = tuple(
            polygon
            for member, path in zip(members, paths, strict=True)
            for polygon in _polygons(member, path, "", reading)
        )
    except RecursionError:
        raise InvalidInputError(
            _POLYGON, "", "is nested too deeply; give its polygons as features"
        ) from None
    _check_level(reading)
    found = PolygonSet(polygons, (*_notes(reading.remarks), *_note_on_levels(reading)))
    return _in_metres(found) if _in_degrees(found, members[0]) else found


def _is_json(line: str) -> bool:
    try:
        json.loads(line)
    except (ValueError, RecursionError):
        return False
    return True


def _polygons(value: Any, field: str, label: str, reading: _Reading) -> Iterator[LabelledPolygon]:
    """Yield the polygons of any GeoJSON object; ``field`` is its path."""
    item = mapping(value, field, _POLYGON, "a GeoJSON object")
    kind, at = item.get("type"), _path(field, "coordinates")
    match kind:
        case "FeatureCollection":
            yield from _members(item, field, "features", label, reading)
        case "GeometryCollection":
            yield from _members(item, field, "geometries", label, reading)
        case "Feature":
            yield from _of_feature(item, field, reading)
        case str() if kind in _GEOMETRIES and item.get("coordinates") == []:
            reading.remarks.append((field, "nowhere"))
        case "Polygon":
            yield _polygon(item.get("coordinates"), at, label)
        case "MultiPolygon":
            for k, part in enumerate(sequence(item.get("coordinates"), at, _POLYGON, "polygons")):
                yield _polygon(part, f"{at}[{k}]", label)
        case "LineString" if _is_ring(item.get("coordinates")):
            reading.remarks.append((field, "a closed line"))
            yield LabelledPolygon((_ring(item["coordinates"], at),), label)
        case str() if kind in _GEOMETRIES:
            reading.remarks.append((field, _GEOMETRIES[kind]))
        case _:
            raise InvalidInputError(
                _POLYGON,
                _path(field, "type"),
                f"is {shown(kind)}{'' if kind is None else ', which GeoJSON does not have'}; "
                "give Polygon or MultiPolygon, alone or in features",
            )


def _of_feature(item: dict[str, Any], field: str, reading: _Reading) -> Iterator[LabelledPolygon]:
    if not _on_level(item, reading):
        return
    if item.get("geometry", 0) is None:
        reading.remarks.append((field, "nowhere"))
        return
    name, sure = _label(item), _certainty(item)
    for each in _polygons(item.get("geometry"), _path(field, "geometry"), name, reading):
        yield replace(each, certainty=sure)


def _members(
    item: dict[str, Any], field: str, key: str, label: str, reading: _Reading
) -> Iterator[LabelledPolygon]:
    at = _path(field, key)
    for k, member in enumerate(sequence(item.get(key), at, _POLYGON, f"a list of {key}")):
        yield from _polygons(member, f"{at}[{k}]", label, reading)


def _properties(feature: dict[str, Any]) -> dict[str, Any]:
    properties = feature.get("properties")
    return properties if isinstance(properties, dict) else {}


def _label(feature: dict[str, Any]) -> str:
    given = {key.lower(): value for key, value in reversed(_properties(feature).items())}
    keys = ("label", "name", "alt_name", "ref")
    names = (name for key in keys for name in _in_any_language(given.get(key)))
    return next((name for name in map(plain_name, (*names, feature.get("id"))) if name), "")


def _in_any_language(name: Any) -> Iterable[Any]:
    return name.values() if isinstance(name, dict) else (name,)


def _on_level(feature: dict[str, Any], reading: _Reading) -> bool:
    """Whether a feature is on the level that is read, if one is; its levels are counted."""
    given = _properties(feature)
    level = plain_name(given.get("level_id")) or plain_name(given.get("level"))
    levels = {each.strip() for each in level.split(";")} - {""}
    reading.levels.update(levels)
    return not reading.level or reading.level in levels


def _check_level(reading: _Reading) -> None:
    if reading.level not in ("", *reading.levels):
        if not reading.levels:
            no_parts(reading.level)
        raise InvalidInputError(
            Reason.INVALID_FILE,
            "",
            f"has no level {quoted(reading.level)}; choose one of {listed(sorted(reading.levels))}",
        )


def _note_on_levels(reading: _Reading) -> Iterator[str]:
    if not reading.level and len(reading.levels) > 1:
        most = reading.levels.most_common(_MOST_LEVELS)
        counts = ", ".join(f"{cleaned_label(level)} ({count})" for level, count in most)
        yield f"The objects are on several levels, of which FILE#LEVEL chooses one: {counts}."


def _certainty(feature: dict[str, Any]) -> float:
    """Return the certainty that a scene was saved with; what others call so may be anything."""
    given = _properties(feature).get("certainty")
    if not isinstance(given, int | float) or isinstance(given, bool):
        return 1.0
    return float(given) if 0.0 < given <= 1.0 else 1.0


def _polygon(value: Any, field: str, label: str) -> LabelledPolygon:
    rings = sequence(value, field, _POLYGON, "a list of rings")
    return LabelledPolygon(
        tuple(_ring(ring, f"{field}[{k}]") for k, ring in enumerate(rings)), label
    )


def _is_ring(value: Any) -> bool:
    """Whether a line is what the RFC calls a linear ring."""
    return isinstance(value, list) and len(value) >= 4 and value[0] == value[-1]


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


def _notes(remarks: list[tuple[str, str]]) -> tuple[str, ...]:
    """Say of each kind of remark how many things it is about, and where the first one is."""
    counts = Counter(kind for _, kind in remarks)
    first = {kind: field for field, kind in reversed(remarks)}
    notes = []
    for kind, count in counts.items():
        others = f" and {count - 1} more" if count > 1 else ""
        where, several = f"{first[kind] or 'The geometry'}{others}", count > 1
        left_out = f"{where} {'were' if several else 'was'} left out"
        if kind == "a closed line":
            taken = "are closed lines, taken as the outlines of objects"
            if not several:
                taken = "is a closed line, taken as the outline of an object"
            notes.append(f"{where} {taken}.")
        elif kind == "nowhere":
            notes.append(f"{left_out}: {'they have' if several else 'it has'} no place.")
        else:
            notes.append(f"{left_out}: {kind} enclose no area.")
    return tuple(notes)


def _in_degrees(found: PolygonSet, document: Any) -> bool:
    """Whether coordinates are longitudes and latitudes."""
    points = _points(found)
    if not may_be_degrees(points, document):
        return False
    return names_degrees(document) or bool(np.ptp(points, axis=0).max() < SPAN)


def _in_metres(found: PolygonSet) -> PolygonSet:
    """Turn longitudes and latitudes into metres east and north of their middle."""
    middle = middle_of(_points(found))
    polygons = tuple(
        replace(item, rings=tuple(frozen_floats(in_metres(ring, middle)) for ring in item.rings))
        for item in found.polygons
    )
    return PolygonSet(polygons, (*found.notes, TURNED), geographic_origin=middle)


def _points(found: PolygonSet) -> FloatArray:
    rings = [ring for item in found.polygons for ring in item.rings]
    return np.concatenate(rings) if rings else np.empty((0, 2))
