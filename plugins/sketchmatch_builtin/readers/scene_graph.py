"""Scene graphs of Hydra."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
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
    plain_name,
    sequence,
)
from sketchmatch.model import FloatArray, PolygonSet
from sketchmatch.model.limits import check_vertices

from ._areas import Areas, area_within, check_elements, ellipse, within_reach

__all__ = ["SceneGraphReader"]

_POLYGON = Reason.INVALID_POLYGON
_OBJECTS, _PLACES, _ROOMS = "objects", "places", "rooms"
_PARTS = (_OBJECTS, _ROOMS)
# Where a graph says nothing else, Spark-DSG numbers its layers so.
_LAYERS = {2: _OBJECTS, 3: _PLACES, 4: _ROOMS}
_TYPES = {
    "ObjectNodeAttributes": _OBJECTS,
    "KhronosObjectAttributes": _OBJECTS,
    "PlaceNodeAttributes": _PLACES,
    "Place2dNodeAttributes": _PLACES,
    "RoomNodeAttributes": _ROOMS,
}
# A name that only repeats a node's symbol, as O(12) or R3.
_SYMBOL = re.compile(r"[A-Za-z]\(?\d+\)?")
# Metres: what stands for a place that has no distance to the next obstacle.
_LEAST_RADIUS = 0.1


@dataclass(frozen=True, eq=False)
class _Node:
    kind: str
    id: Any
    attributes: dict[str, Any]
    field: str


class SceneGraphReader(Reader):
    """Reads the objects, or the rooms, of a scene graph seen from above, in metres.

    An object is its bounding box. A room is its bounding box, or what its places cover where it
    has none: a place is a disc as wide as its distance to the next obstacle. Names are those of the
    nodes, or else of their classes. ``dsg.json#rooms`` reads the rooms, ``#objects`` the objects
    and ``#objects,rooms`` both; without it objects are read, or rooms where there is no object.

    References
    ----------
    N. Hughes, Y. Chang, L. Carlone, "Hydra: A Real-time Spatial Perception System for 3D Scene
    Graph Construction and Optimization", Robotics: Science and Systems, 2022; as Spark-DSG saves
    it.

    Examples
    --------
    >>> box = '{"type": "AABB", "dimensions": [2, 1, 1], "world_P_center": [5, 5, 0]}'
    >>> node = f'{{"id": 1, "layer": 2, "attributes": {{"name": "desk", "bounding_box": {box}}}}}'
    >>> graph = f'{{"layer_ids": [2], "nodes": [{node}], "edges": []}}'
    >>> found = SceneGraphReader().read(graph.encode())
    >>> found.polygons[0].label, found.polygons[0].rings[0].max(axis=0).tolist()
    ('desk', [6.0, 5.5])
    """

    name = "scene-graph"
    summary = "Objects or rooms of a scene graph of Hydra; FILE#rooms chooses rooms."
    keys = ("nodes", "layer_ids")
    source = PolygonSet

    def read(self, data: bytes, part: str = "") -> PolygonSet:
        """Return the objects or rooms as polygons, in metres."""
        document = mapping(load_json(decode_text(data)), "", _POLYGON, "a scene graph")
        nodes = list(_nodes(document))
        wanted = _wanted(nodes, part)
        classes = _classes(document)
        places = _places_of_rooms(document, nodes) if _ROOMS in wanted else {}
        check_elements(sum(node.kind in wanted for node in nodes), "nodes", "objects")
        areas = Areas()
        for node in nodes:
            if node.kind in wanted:
                area = _area(node) or _covered(places.get(node.id, ()))
                if area is None:
                    areas.leave_out(f"{node.kind} without a bounding box")
                else:
                    areas.add(area, _name(node, classes))
        return areas.polygon_set(*_notes(nodes, wanted, part), upwards=1.0)


def _nodes(document: dict[str, Any]) -> Iterator[_Node]:
    """Yield the nodes that are objects, places or rooms."""
    layers = _layers(document)
    items = sequence(document.get("nodes"), "nodes", _POLYGON, "a list of nodes")
    for k, item in enumerate(items):
        node = mapping(item, f"nodes[{k}]", _POLYGON, "a node")
        field = f"nodes[{k}].attributes"
        attributes = mapping(node.get("attributes"), field, _POLYGON, "the node's attributes")
        said, layer = attributes.get("type"), node.get("layer")
        kind = _TYPES.get(said) if isinstance(said, str) else None
        if kind is None and isinstance(layer, int):
            kind = layers.get(layer)
        identity = node.get("id")
        if kind is not None and isinstance(identity, int | str):
            yield _Node(kind, identity, attributes, field)


def _layers(document: dict[str, Any]) -> Mapping[int, str]:
    """Return what is in each layer, by its number."""
    names = document.get("layer_names")
    said = {}
    for name, key in names.items() if isinstance(names, dict) else ():
        layer = key.get("layer") if isinstance(key, dict) else key
        if isinstance(layer, int) and name.lower() in _LAYERS.values():
            said[layer] = name.lower()
    return said or _LAYERS


def _wanted(nodes: list[_Node], part: str) -> set[str]:
    if not part:
        there = {node.kind for node in nodes}
        return {_OBJECTS} if _OBJECTS in there else {_ROOMS}
    wanted = {name.strip().lower() for name in part.split(",")}
    if not wanted <= set(_PARTS):
        raise InvalidInputError(
            Reason.INVALID_FILE,
            "",
            f"has no part {listed([part])}; choose objects, rooms, or objects,rooms",
        )
    return wanted


def _notes(nodes: list[_Node], wanted: set[str], part: str) -> Iterator[str]:
    if not part:
        for other in sorted(set(_PARTS) - wanted):
            count = sum(node.kind == other for node in nodes)
            if count:
                yield f"The graph also has {other} ({count}); FILE#{other} reads them."


def _classes(document: dict[str, Any]) -> Mapping[int, str]:
    """Return the names of the classes of objects, by their label, as far as the graph has them."""
    metadata = document.get("metadata")
    spaces = metadata.get("labelspaces") if isinstance(metadata, dict) else None
    names: dict[int, str] = {}
    for space in spaces.values() if isinstance(spaces, dict) else ():
        for pair in space if isinstance(space, list) else ():
            if isinstance(pair, list) and len(pair) == 2 and isinstance(pair[0], int):
                names.setdefault(pair[0], plain_name(pair[1]))
    return names


def _name(node: _Node, classes: Mapping[int, str]) -> str:
    name, label = plain_name(node.attributes.get("name")), node.attributes.get("semantic_label")
    if node.kind == _OBJECTS and isinstance(label, int) and (not name or _SYMBOL.fullmatch(name)):
        return classes.get(label, name)
    return name


def _area(node: _Node) -> Any | None:
    """Return what a node's bounding box covers of the floor; None if it has none."""
    given = node.attributes.get("bounding_box")
    if not isinstance(given, dict) or given.get("type") in (None, "INVALID", 0):
        return None
    at = f"{node.field}.bounding_box"
    turned = given.get("type") not in ("AABB", 1)
    if "dimensions" in given:
        half = _vector(given, "dimensions", at) / 2.0
        low, high, middle = -half, half, _vector(given, "world_P_center", at)
    else:
        low, high = _vector(given, "min", at), _vector(given, "max", at)
        # An upright box says where it is by its corners, and a turned one by its middle.
        middle = _vector(given, "world_P_center", at) if turned else np.zeros(3)
    if not (high > low)[:2].all():
        return None
    corners = np.array(
        [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
    rotation = (
        _rotation(given.get("world_R_center"), f"{at}.world_R_center") if turned else np.eye(3)
    )
    seen = (corners @ rotation.T + middle)[:, :2]
    return shapely.MultiPoint(within_reach(seen)).convex_hull


def _rotation(value: Any, field: str) -> FloatArray:
    """Return the rotation that a quaternion is."""
    given = mapping(value, field, _POLYGON, "a quaternion with w, x, y and z")
    w, x, y, z = (number(given.get(key), f"{field}.{key}", _POLYGON) for key in "wxyz")
    length = math.sqrt(w * w + x * x + y * y + z * z)
    if not 0.0 < length < math.inf:
        raise InvalidInputError(_POLYGON, field, "is not a rotation; give a unit quaternion")
    w, x, y, z = w / length, x / length, y / length, z / length
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _vector(given: dict[str, Any], key: str, field: str) -> FloatArray:
    values = sequence(given.get(key), f"{field}.{key}", _POLYGON, "[x, y, z]")
    if len(values) != 3:
        raise InvalidInputError(
            _POLYGON, f"{field}.{key}", f"is a list of {len(values)}; give [x, y, z]"
        )
    return np.array([number(v, f"{field}.{key}[{i}]", _POLYGON) for i, v in enumerate(values)])


def _places_of_rooms(document: dict[str, Any], nodes: list[_Node]) -> dict[Any, list[Any]]:
    """Return what the places of each room cover."""
    rooms = {node.id for node in nodes if node.kind == _ROOMS}
    places = {node.id: node for node in nodes if node.kind == _PLACES}
    within: dict[Any, dict[Any, None]] = {}
    edges = sequence(document.get("edges", []), "edges", _POLYGON, "a list of edges")
    for k, item in enumerate(edges):
        edge = mapping(item, f"edges[{k}]", _POLYGON, "an edge")
        ends = edge.get("source"), edge.get("target")
        for room, place in (ends, ends[::-1]):
            if (
                isinstance(room, int | str)
                and room in rooms
                and isinstance(place, int | str)
                and place in places
            ):
                within.setdefault(room, {})[place] = None
    areas = {key: _place(places[key]) for key in {key for each in within.values() for key in each}}
    sizes = {key: int(shapely.get_num_coordinates(area)) for key, area in areas.items()}
    check_vertices(sum(sizes[key] for each in within.values() for key in each), "nodes")
    return {room: [areas[key] for key in each] for room, each in within.items()}


def _place(node: _Node) -> Any:
    boundary = node.attributes.get("boundary")
    if isinstance(boundary, list) and len(boundary) >= 3:
        corners = [
            [
                number(v, f"{node.field}.boundary[{k}]", _POLYGON)
                for v in sequence(point, f"{node.field}.boundary[{k}]", _POLYGON, "[x, y, z]")[:2]
            ]
            for k, point in enumerate(boundary)
        ]
        if all(len(corner) == 2 for corner in corners):
            return area_within(corners)
    x, y, _ = _vector(node.attributes, "position", node.field)
    radius = node.attributes.get("distance")
    radius = (
        radius if isinstance(radius, int | float) and 0.0 < radius < math.inf else _LEAST_RADIUS
    )
    return area_within(ellipse(x, y, radius, radius))


def _covered(places: Any) -> Any | None:
    """Return one area around places; None if there is none."""
    areas = list(places)
    if not areas:
        return None
    together = shapely.union_all(areas)
    return together if together.geom_type == "Polygon" else together.convex_hull
