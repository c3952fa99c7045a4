"""Points, routes and zones as files: GeoJSON in and out, and what nav2 reads.

In GeoJSON a ``Point`` is a point, a ``LineString`` a route, a ``Polygon`` a zone; each part of what
has several is one of its own. The coordinates are those of the scene, x right and y up, in its own
units. The property ``name``, or else ``label``, or else the ``id``, is the name; ``speed``, one
number, or ``speeds``, one for each point, says how fast a route is driven; ``yaw``, in radians,
where a robot looks at a point; ``keepout: false`` leaves a zone out of the keep-out mask,
``waypoint: false`` a point or route out of the waypoints. All properties are kept.

A mask of nav2's keep-out filter, which is a map in which the forbidden cells are occupied, is read
as zones that cover all of these, and a list of waypoints as nav2's panel in RViz saves it as points
in their order.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from sketchmatch.api.documents import decode_text, load_json, mapping, number, plain_name, sequence
from sketchmatch.errors import InvalidInputError, Reason, quoted
from sketchmatch.io._targets import check_target, writing
from sketchmatch.io.degrees import SPAN, from_metres, in_metres, may_be_degrees, names_degrees
from sketchmatch.io.files import read_bytes, read_map_files
from sketchmatch.io.geojson import TURNED
from sketchmatch.io.ros_map import MapServerHeader, in_yaml
from sketchmatch.kernels.raster import pixel_edges
from sketchmatch.model import FloatArray, OccupancyGrid
from sketchmatch.transfers.features import Carried, Feature, FeatureKind
from sketchmatch.transfers.obstacles import Obstacles, reached
from sketchmatch_map_files import YAML_SUFFIXES, MapFileError, parse, text_of

__all__ = [
    "FeatureFile",
    "check_targets",
    "encode_carried",
    "encode_keepout",
    "encode_waypoints",
    "landmarks_of",
    "read_features",
    "save_keepout",
    "save_text",
]

_FILE = Reason.INVALID_FILE
_KINDS = {
    "Point": FeatureKind.POINT,
    "LineString": FeatureKind.ROUTE,
    "Polygon": FeatureKind.ZONE,
}
_SEVERAL = {"MultiPoint": "Point", "MultiLineString": "LineString", "MultiPolygon": "Polygon"}
_JSON_SUFFIXES = (".geojson", ".json")
_SPEEDS = ("speed", "speeds")
_ANSWERS = ("deviation", "deviations", "changes")
_FREE, _FORBIDDEN = 254, 0
_NEAR = 1.0
"""Degrees, from the middle of a scene: features of it lie nearer."""
_SMALL = 0.01
"""Nothing that is carried is as small in metres or pixels; in degrees it is a kilometre."""
_STEP = 0.5
"""In cells: by how much the outlines of a mask may be simplified."""
_ROUNDING = 1e-9
_CRS84 = {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}
_OCCUPIED = 65
_PALER = "{} cells of the mask are neither free nor forbidden, and were left out."


@dataclass(frozen=True, eq=False)
class FeatureFile:
    """What stands in a file.

    Attributes
    ----------
    features
        The points, routes and zones, in their order.
    properties
        What else is said of each.
    notes
        What was decided in reading it, each one sentence.
    """

    features: tuple[Feature, ...]
    properties: tuple[Mapping[str, Any], ...]
    notes: tuple[str, ...] = ()

    def __add__(self, other: FeatureFile) -> FeatureFile:
        return FeatureFile(
            self.features + other.features,
            self.properties + other.properties,
            self.notes + other.notes,
        )


def read_features(path: str | Path, origin: tuple[float, float] | None = None) -> FeatureFile:
    """Read points, routes and zones from GeoJSON, a keep-out mask or a list of waypoints.

    Parameters
    ----------
    path
        The file.
    origin
        Longitude and latitude of the place that is (0, 0) in the scene that they are of, if that
        scene's file has such: then those of the features become metres, too.

    Raises
    ------
    InvalidInputError
        In one sentence that begins with the path, if the file cannot be used.
    """
    path = Path(path)
    try:
        found = _read(path, origin)
    except InvalidInputError as error:
        if error.field.startswith(str(path)):
            raise
        place = f"{path}: {error.field}" if error.field else str(path)
        raise InvalidInputError(error.reason, place, error.problem) from None
    if not found.features:
        raise InvalidInputError(
            _FILE,
            str(path),
            "holds no point, route or zone; give one as a Point, LineString or Polygon",
        )
    return found


def landmarks_of(grid: OccupancyGrid) -> FeatureFile:
    """Return the names that a map's own file gives to things of it, which are no waypoints."""
    features = [
        Feature(FeatureKind.POINT, (np.array([item.point]),), item.name) for item in grid.landmarks
    ]
    properties = [
        {"name": item.name, **({"type": item.kind} if item.kind else {}), "waypoint": False}
        for item in grid.landmarks
    ]
    return FeatureFile(tuple(features), tuple(properties))


def encode_carried(
    carried: Sequence[Carried],
    properties: Sequence[Mapping[str, Any]],
    rotation: float,
    origin: tuple[float, float] | None = None,
) -> str:
    """Return carried features as GeoJSON, with what each had, its deviations and changes.

    Parameters
    ----------
    carried
        The features, in their order. What could not be carried has no geometry.
    properties
        What else is said of each.
    rotation
        By how much the whole was turned, in radians: so is every ``yaw``.
    origin
        Longitude and latitude of the place that is (0, 0) where they were carried to: then these
        are written. Deviations stay in metres.
    """
    features = ",\n".join(
        json.dumps(_encoded(each, said, rotation, origin), ensure_ascii=False, allow_nan=False)
        for each, said in zip(carried, properties, strict=True)
    )
    crs = json.dumps(None if origin is None else _CRS84)
    return f'{{"type": "FeatureCollection", "crs": {crs}, "features": [\n{features}\n]}}\n'


def encode_keepout(
    carried: Sequence[Carried],
    properties: Sequence[Mapping[str, Any]],
    grid: OccupancyGrid,
    picture: str,
) -> tuple[str, bytes]:
    """Return the mask of nav2's keep-out filter for all zones, over the cells of a map.

    Parameters
    ----------
    carried, properties
        As :func:`encode_carried` takes them; zones with ``keepout: false`` are left out.
    grid
        The map; every cell of it of which a zone covers a part, however small, is forbidden. One
        that a zone touches at a side or a corner alone is free.
    picture
        Name of the picture's file.

    Returns
    -------
    str, bytes
        The YAML, and its picture as PGM.
    """
    cells = Obstacles.of_grid(grid, allow_unknown=True)
    zones = [
        [cells.local(ring) for ring in each.feature.rings]
        for each, said in zip(carried, properties, strict=True)
        if each.kind is FeatureKind.ZONE and each.feature is not None
        if said.get("keepout") is not False
    ]
    shades = np.full(grid.cells.shape, _FREE, dtype=np.uint8)
    shades[reached(zones, shades.shape)] = _FORBIDDEN
    rows, columns = grid.cells.shape
    document = MapServerHeader(grid.resolution, grid.origin, False, 0.65, 0.25, "trinary")
    header = f"P5\n{columns} {rows}\n255\n".encode("ascii")
    return document.text(picture), header + shades[::-1].tobytes()


def encode_waypoints(
    carried: Sequence[Carried], properties: Sequence[Mapping[str, Any]], rotation: float
) -> str:
    """Return points and the points of routes, in their order, as nav2's panel in RViz saves them.

    Those with ``waypoint: false`` are left out. A robot looks along a route, and at a point as its
    ``yaw`` said, turned by the rotation. Names and speeds stand beside, where there are some.
    """
    lines, count = ["waypoints:"], 0
    for each, said in zip(carried, properties, strict=True):
        if each.feature is None or each.kind is FeatureKind.ZONE or said.get("waypoint") is False:
            continue
        points = each.feature.points
        headings = _headings(points) if len(points) > 1 else [_yaw(said, rotation) or 0.0]
        speeds: Sequence[float | None] = [_number_of(said, "speed")] * len(points)
        if each.feature.speeds is not None:
            speeds = each.feature.speeds.tolist()
        for k, (point, heading) in enumerate(zip(points, headings, strict=True)):
            w, z = math.cos(heading / 2.0), math.sin(heading / 2.0)
            lines += [
                f"  waypoint{count}:",
                f"    pose: [{point[0]:.6f}, {point[1]:.6f}, 0.0]",
                f"    orientation: [{w:.6f}, 0.0, 0.0, {z:.6f}]",
            ]
            if each.name:
                lines.append(f"    name: {in_yaml(each.name)}")
            if (speed := speeds[k]) is not None:
                lines.append(f"    speed: {speed:.6g}")
            count += 1
    return "\n".join(lines if count else ["waypoints: {}"]) + "\n"


def check_targets(out: Path | None, keepout: Path | None, waypoints: Path | None) -> None:
    """Refuse paths that nothing can be saved under, before any work is done."""
    if out is not None:
        check_target(out, "--out", _JSON_SUFFIXES, ".geojson")
    for path, field in ((keepout, "--keepout"), (waypoints, "--waypoints")):
        if path is not None:
            check_target(path, field, YAML_SUFFIXES, ".yaml")
    if keepout and waypoints and keepout.resolve() == waypoints.resolve():
        problem = f"is {str(waypoints)!r}, under which --keepout is saved; give another name"
        raise InvalidInputError(_FILE, "--waypoints", problem)


def save_text(path: Path, text: str, field: str) -> None:
    """Save a text."""
    with writing(path, field):
        path.write_bytes(text.encode("utf-8", "backslashreplace"))


def save_keepout(path: Path, document: str, picture: bytes, field: str) -> None:
    """Save a mask: the YAML under its path, the picture beside it."""
    with writing(path, field):
        path.with_suffix(".pgm").write_bytes(picture)
    save_text(path, document, field)


def _read(path: Path, origin: tuple[float, float] | None) -> FeatureFile:
    if path.suffix.lower() not in YAML_SUFFIXES:
        document = load_json(decode_text(read_bytes(path)))
        return _in_metres(_of_geojson(document), document, origin)
    try:
        values = parse(text_of(read_bytes(path))).values
    except MapFileError as error:
        raise InvalidInputError(_FILE, "", str(error)) from None
    if isinstance(values, dict) and "waypoints" in values:
        return _of_waypoints(values["waypoints"])
    files = read_map_files(path)
    if files is None:
        raise InvalidInputError(
            _FILE, "", "is neither a mask of nav2's keep-out filter nor waypoints; give one of them"
        )
    return _of_mask(files.grid())


def _of_geojson(document: Any) -> FeatureFile:
    features: list[Feature] = []
    properties: list[Mapping[str, Any]] = []
    notes: list[str] = []
    kind = mapping(document, "", _FILE, "GeoJSON").get("type")
    members = [document]
    if kind == "FeatureCollection":
        members = sequence(document.get("features"), "features", _FILE, "a list of features")
    for k, member in enumerate(members):
        field = f"features[{k}]" if kind == "FeatureCollection" else ""
        about = f"{field}.properties" if field else "properties"
        said: Mapping[str, Any] = {}
        geometry: Any = mapping(member, field, _FILE, "a feature")
        if geometry.get("type") == "Feature":
            given = geometry.get("properties")
            said = given if isinstance(given, dict) else {}
            name = next(
                (
                    text
                    for text in map(
                        plain_name, (said.get("name"), said.get("label"), geometry.get("id"))
                    )
                    if text
                ),
                "",
            )
            geometry = geometry.get("geometry")
            field = f"{field}.geometry" if field else "geometry"
        else:
            name = ""
        if geometry is None:
            which = f" {quoted(name)}" if name else ""
            place = field.removesuffix(".geometry")
            notes.append(f"{place}{which} was left out: it has no place.")
            continue
        for part, at in _parts(mapping(geometry, field, _FILE, "a geometry"), field):
            features.append(_of_part(part, at, name, said, about))
            properties.append(said)
    return FeatureFile(tuple(features), tuple(properties), tuple(notes))


def _in_metres(
    found: FeatureFile, document: Any, origin: tuple[float, float] | None
) -> FeatureFile:
    """Return features as they are in their scene, whose origin has a longitude and latitude."""
    rings = [ring for each in found.features for ring in each.rings]
    points = np.vstack(rings) if rings else np.empty((0, 2))
    if not may_be_degrees(points, document):
        return found
    if origin is not None and (np.abs(points - origin) < _NEAR).all():
        features = tuple(
            replace(each, rings=tuple(in_metres(ring, origin) for ring in each.rings))
            for each in found.features
        )
        return replace(found, features=features, notes=(*found.notes, TURNED))
    span = float(np.ptp(points, axis=0).max())
    # One point in metres, of a scene in metres, is small as well.
    small = span < _SMALL and (span > 0.0 or origin is not None)
    if small or (span < SPAN and names_degrees(document)):
        where = "has none" if origin is None else "lies elsewhere"
        raise InvalidInputError(
            _FILE,
            "",
            f"holds longitudes and latitudes, but the sketch or map {where}; give coordinates of "
            'the sketch or map, or add "crs": null if these already are',
        )
    return found


def _parts(geometry: dict[str, Any], field: str) -> list[tuple[dict[str, Any], str]]:
    kind, at = geometry.get("type"), f"{field}.coordinates" if field else "coordinates"
    if kind in _KINDS:
        return [(geometry, at)]
    if kind in _SEVERAL:
        several = sequence(geometry.get("coordinates"), at, _FILE, "a list of parts")
        return [
            ({"type": _SEVERAL[kind], "coordinates": each}, f"{at}[{k}]")
            for k, each in enumerate(several)
        ]
    raise InvalidInputError(
        _FILE,
        f"{field}.type" if field else "type",
        "is not a geometry that can be carried; give a Point, LineString or Polygon",
    )


def _of_part(
    part: dict[str, Any], at: str, name: str, said: Mapping[str, Any], about: str
) -> Feature:
    kind, given = _KINDS[part["type"]], part.get("coordinates")
    if kind is FeatureKind.POINT:
        rings = [_line([given], at)]
    elif kind is FeatureKind.ROUTE:
        rings = [_line(given, at)]
    else:
        lines = sequence(given, at, _FILE, "a list of rings")
        rings = [_line(each, f"{at}[{k}]") for k, each in enumerate(lines)]
    if kind is FeatureKind.POINT and said.get("yaw") is not None:
        number(said["yaw"], f"{about}.yaw", _FILE)
    speeds = _speeds(said, len(rings[0]), about) if kind is FeatureKind.ROUTE else None
    try:
        return Feature(kind, tuple(rings), name, speeds)
    except InvalidInputError as error:
        place = f"{about}.speeds" if error.field == "speeds" else at
        raise InvalidInputError(_FILE, place, error.problem) from None


def _line(given: Any, field: str) -> FloatArray:
    rows = []
    for k, position in enumerate(sequence(given, field, _FILE, "a list of [x, y] positions")):
        at = f"{field}[{k}]"
        pair = sequence(position, at, _FILE, "a position [x, y]")
        if len(pair) < 2:
            raise InvalidInputError(_FILE, at, "has fewer than two numbers; give [x, y]")
        rows.append([number(pair[i], f"{at}[{i}]", _FILE) for i in (0, 1)])
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def _speeds(said: Mapping[str, Any], count: int, about: str) -> FloatArray | None:
    if said.get("speeds") is not None:
        field = f"{about}.speeds"
        given = sequence(said["speeds"], field, _FILE, "a list of numbers")
        return np.array([number(each, f"{field}[{k}]", _FILE) for k, each in enumerate(given)])
    if said.get("speed") is not None:
        return np.full(count, number(said["speed"], f"{about}.speed", _FILE))
    return None


def _of_waypoints(given: Any) -> FeatureFile:
    named = mapping(given, "waypoints", _FILE, "waypoints by name, as nav2's panel saves them")
    features, properties = [], []
    for key, value in named.items():
        field = f"waypoints.{key}"
        item = mapping(value, field, _FILE, "pose and orientation")
        place = _line([_numbers(item.get("pose"))], f"{field}.pose")
        name = plain_name(item.get("name")) or str(key)
        said: dict[str, Any] = {"name": name}
        if (turned := _numbers(item.get("orientation"))) is not None:
            said["yaw"] = _heading(turned, f"{field}.orientation")
        if (speed := _numbers(item.get("speed"))) is not None:
            said["speed"] = number(speed, f"{field}.speed", _FILE)
        features.append(Feature(FeatureKind.POINT, (place,), name))
        properties.append(said)
    return FeatureFile(tuple(features), tuple(properties))


def _heading(given: Any, field: str) -> float:
    """Return where a robot looks that was turned by a quaternion, about z alone."""
    values = sequence(given, field, _FILE, "[w, x, y, z]")
    if len(values) != 4:
        raise InvalidInputError(_FILE, field, f"has {len(values)} numbers; give [w, x, y, z]")
    w, _, _, z = (number(each, field, _FILE) for each in values)
    return 2.0 * math.atan2(z, w)


def _numbers(value: Any) -> Any:
    """Return what stands in a YAML with its texts as numbers where they are some."""
    if isinstance(value, list):
        return [_numbers(each) for each in value]
    try:
        return float(value)
    except (TypeError, ValueError):
        return value


def _of_mask(grid: OccupancyGrid) -> FeatureFile:
    """Return what is forbidden as zones, which cover all of it."""
    edges = np.stack(pixel_edges(grid.cells >= _OCCUPIED), axis=1)
    outlines = shapely.MultiLineString(list(edges))
    cells = Obstacles.of_grid(grid, allow_unknown=True)
    zones = map(_plainer, shapely.get_parts(shapely.build_area(outlines)))
    features = tuple(
        Feature(
            FeatureKind.ZONE,
            tuple(
                cells.placed(shapely.get_coordinates(ring)[:, ::-1])
                for ring in (zone.exterior, *zone.interiors)
            ),
            f"keep-out {k + 1}",
        )
        for k, zone in enumerate(zones)
    )
    paler = int(((grid.cells > 0) & (grid.cells < _OCCUPIED)).sum())
    notes = (_PALER.format(paler),) if paler else ()
    return FeatureFile(features, tuple({"name": each.name} for each in features), notes)


def _plainer(area: shapely.Polygon) -> shapely.Polygon:
    """Return an area of cells without the steps of its slanted sides, which covers it."""
    plain = shapely.simplify(area, _STEP)
    corners = shapely.points(shapely.get_coordinates(area))
    for wider in (0.0, float(shapely.distance(corners, plain).max()), _STEP):
        found = shapely.buffer(plain, wider, join_style="mitre", mitre_limit=2.0)
        if found.geom_type == "Polygon" and found.buffer(_ROUNDING).covers(area):
            return found
    return area


def _encoded(
    carried: Carried,
    said: Mapping[str, Any],
    rotation: float,
    origin: tuple[float, float] | None,
) -> dict[str, Any]:
    speeds = None if carried.feature is None else carried.feature.speeds
    replaced = _ANSWERS if speeds is None else (*_ANSWERS, *_SPEEDS)
    kept = {key: value for key, value in said.items() if key not in replaced}
    kept.setdefault("name", carried.name)
    if (yaw := _yaw(said, rotation)) is not None:
        kept["yaw"] = round(yaw, 6)
    if speeds is not None:
        kept["speeds"] = [round(float(each), 6) for each in speeds]
    if carried.feature is not None:
        kept["deviation"] = round(carried.deviation, 6)
        kept["deviations"] = [
            [round(float(each), 6) for each in ring] for ring in carried.deviations
        ]
    if carried.changes:
        kept["changes"] = [
            {
                "reason": str(each.reason),
                "first": each.first,
                "last": each.last,
                "sentence": each.sentence,
            }
            for each in carried.changes
        ]
    return {"type": "Feature", "properties": kept, "geometry": _geometry(carried.feature, origin)}


def _geometry(feature: Feature | None, origin: tuple[float, float] | None) -> dict[str, Any] | None:
    if feature is None:
        return None
    rings = feature.rings
    if origin is not None:
        rings = tuple(from_metres(ring, origin) for ring in rings)
    lines = [ring.tolist() for ring in rings]
    if feature.kind is FeatureKind.POINT:
        return {"type": "Point", "coordinates": lines[0][0]}
    if feature.kind is FeatureKind.ROUTE:
        return {"type": "LineString", "coordinates": lines[0]}
    return {"type": "Polygon", "coordinates": [[*line, line[0]] for line in lines]}


def _headings(points: FloatArray) -> list[float]:
    """Return where each point of a route looks: to the next elsewhere, the last as before."""
    steps = np.diff(points, axis=0)
    moving = np.flatnonzero(steps.any(axis=1))
    if not len(moving):
        return [0.0] * len(points)
    ahead = np.searchsorted(moving, np.arange(len(points))).clip(max=len(moving) - 1)
    x, y = steps[moving[ahead]].T
    found: list[float] = np.arctan2(y, x).tolist()
    return found


def _yaw(said: Mapping[str, Any], rotation: float) -> float | None:
    given = _number_of(said, "yaw")
    return None if given is None else math.remainder(given + rotation, 2.0 * math.pi)


def _number_of(said: Mapping[str, Any], key: str) -> float | None:
    given = said.get(key)
    if isinstance(given, bool) or not isinstance(given, int | float) or not math.isfinite(given):
        return None
    return float(given)
