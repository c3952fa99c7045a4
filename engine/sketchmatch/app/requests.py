"""From request messages to the engine's values."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Literal, TypeAlias

import numpy as np
from google.protobuf import struct_pb2
from google.protobuf.descriptor import EnumDescriptor

from sketchmatch.api import Segmentation
from sketchmatch.app.setup import RequestLimits
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io.files import FileKind, decode_file, kind_of_file
from sketchmatch.io.images import decode_image
from sketchmatch.io.ros_map import decode_map_server
from sketchmatch.model import (
    ConfidenceWeights,
    FloatArray,
    Image,
    LabelledPolygon,
    OccupancyGrid,
    PolygonSet,
    Source,
    Stroke,
    StrokeSet,
)
from sketchmatch.model.limits import check_objects, check_pixels, check_vertices
from sketchmatch.pipeline.knowledge import Pin
from sketchmatch.pipeline.request import MatchRequest
from sketchmatch.pipeline.selection import STAGES, Choice, Selection
from sketchmatch.registry import RegisteredReader
from sketchmatch.transfers.features import Feature, FeatureKind
from sketchmatch.transfers.transfer import Direction, TransferRequest
from sketchmatch_proto.v1 import (
    match_pb2,
    match_service_pb2,
    pipeline_pb2,
    scene_service_pb2,
    source_pb2,
    transfer_service_pb2,
)

__all__ = [
    "Stored",
    "checked_choice",
    "choice",
    "file_kind",
    "match_request",
    "paths_of",
    "pin",
    "selection",
    "source",
    "source_type",
    "time_budget",
    "transfer_request",
    "upward_of",
]

Stored: TypeAlias = Callable[[str, str], Segmentation]
"""Finds a stored scene by its name; the other text is the path of the field that names it."""
_Matching = match_service_pb2.MatchRequest | transfer_service_pb2.TransferRequest

_KINDS = "stroke_set, polygon_set, occupancy_grid, map_server_map, image or file"
_OPTIONS = ("alternatives", "allow_unmatched", "unmatched_price")
"""Fields that mean the same as those of that name in the engine's request."""
_WHOLE = ("pixels", "cells")
"""What errors call a picture or a grid as a whole."""
_UPWARD: dict[int, float] = {
    source_pb2.Y_AXIS_UNSPECIFIED: 1.0,
    source_pb2.Y_AXIS_UP: 1.0,
    source_pb2.Y_AXIS_DOWN: -1.0,
}
_TYPES: dict[str, type[Source]] = {
    "stroke_set": StrokeSet,
    "polygon_set": PolygonSet,
    "occupancy_grid": OccupancyGrid,
    "map_server_map": OccupancyGrid,
    "image": Image,
}


def match_request(
    request: _Matching,
    limits: RequestLimits,
    readers: Sequence[RegisteredReader] = (),
    stored: Stored | None = None,
) -> MatchRequest:
    """Read a request to match, within some limits.

    Parameters
    ----------
    request, limits
        The request, and what it may ask for.
    readers
        Those of plugins.
    stored
        Finds stored scenes, where these may be named.

    Raises
    ------
    InvalidInputError
        If it cannot be used, with the path of the field.
    """
    if isinstance(request, match_service_pb2.MatchRequest):
        _check_known("priority", request.priority, match_service_pb2.Priority.DESCRIPTOR)
    return MatchRequest(
        sketch=_side(request, "sketch", readers, stored),
        map=_side(request, "map", readers, stored),
        selection={
            stage: checked_choice(getattr(request.pipeline, stage), f"pipeline.{stage}")
            for stage in STAGES
        },
        seed=request.seed,
        time_budget=time_budget(request, limits),
        weights=_weights(request.weights) if request.HasField("weights") else None,
        profile=request.pipeline.profile,
        pins=tuple(pin(each, f"pins[{k}]") for k, each in enumerate(request.pins)),
        synonyms=tuple(tuple(group.labels) for group in request.synonyms),
        **{field.name: value for field, value in request.ListFields() if field.name in _OPTIONS},
    )


def _side(
    request: _Matching,
    side: Literal["sketch", "map"],
    readers: Sequence[RegisteredReader],
    stored: Stored | None,
) -> Source | Segmentation:
    """Read the sketch or the map, which may be a stored scene."""
    message = getattr(request, side)
    if stored is not None and message.WhichOneof("kind") == "stored_scene":
        return stored(message.stored_scene, f"{side}.stored_scene")
    return source(message, side, request.HasField(side), readers)


def transfer_request(
    request: transfer_service_pb2.TransferRequest,
    limits: RequestLimits,
    readers: Sequence[RegisteredReader] = (),
    stored: Stored | None = None,
) -> TransferRequest:
    """Read a request to carry something, within some limits; see :func:`match_request`.

    Raises
    ------
    InvalidInputError
        If it cannot be used, with the path of the field.
    """
    directions = transfer_service_pb2.TransferDirection.DESCRIPTOR
    _check_known("direction", request.direction, directions)
    back = request.direction == transfer_service_pb2.TRANSFER_DIRECTION_MAP_TO_SKETCH
    pairs = tuple((each.sketch_object, each.map_object) for each in request.object_map)
    return TransferRequest(
        match=match_request(request, limits, readers, stored),
        features=_features(request),
        object_map=pairs or None,
        direction=Direction.MAP_TO_SKETCH if back else Direction.SKETCH_TO_MAP,
        radius=request.radius if request.HasField("radius") else None,
        allow_unknown=request.allow_unknown,
    )


def selection(request: _Matching) -> Selection:
    """Read what is asked for in each stage."""
    return {stage: choice(getattr(request.pipeline, stage)) for stage in STAGES}


def checked_choice(message: pipeline_pb2.AlgorithmSelection, field: str) -> Choice:
    """Read what is asked for in one stage, of which every parameter has a value.

    Raises
    ------
    InvalidInputError
        If a ``google.protobuf.Value`` has none, as where code misspelled its kind.
    """
    given = message.parameters.fields if message.HasField("parameters") else {}
    for name, value in given.items():
        if _is_blank(value):
            raise InvalidInputError(
                Reason.INVALID_FIELD,
                f"{field}.parameters.{name}",
                "has no value; set one kind of google.protobuf.Value, such as number_value "
                "(numberValue in JavaScript), or null_value",
            )
    return choice(message)


def choice(message: pipeline_pb2.AlgorithmSelection) -> Choice:
    """Read what is asked for in one stage."""
    if not message.HasField("parameters"):
        return Choice(message.name)
    fields = message.parameters.fields
    return Choice(message.name, {name: _plain(value) for name, value in fields.items()})


def source(
    message: source_pb2.Source,
    field: str,
    present: bool,
    readers: Sequence[RegisteredReader] = (),
) -> Source:
    """Read a sketch or a map.

    Parameters
    ----------
    message
        The source.
    field
        Its path in the request, for errors.
    present
        Whether the request has it at all.
    readers
        Those of plugins, for files.

    Raises
    ------
    InvalidInputError
        If it is missing or cannot be read.
    PluginError
        If a reader fails.
    """
    kind = message.WhichOneof("kind")
    if kind == "stored_scene":
        problem = "names a scene that is stored already; give the source itself"
        raise InvalidInputError(Reason.INVALID_FIELD, f"{field}.stored_scene", problem)
    if not present or kind is None:
        raise InvalidInputError(Reason.MISSING_FIELD, field, f"is not set; give {_KINDS}")
    try:
        match kind:
            case "stroke_set":
                return _stroke_set(message.stroke_set)
            case "polygon_set":
                return _polygon_set(message.polygon_set)
            case "occupancy_grid":
                return _occupancy_grid(message.occupancy_grid)
            case "map_server_map":
                packed = message.map_server_map
                return decode_map_server(
                    packed.yaml, packed.image, packed.objects, packed.own_objects
                )
            case "image":
                return decode_image(message.image.data)
            case "file":
                file = message.file
                return decode_file(file.name, file.data, file.part, readers)
    except InvalidInputError as error:
        raise error.within(f"{field}.{kind}") from None
    raise AssertionError(kind)


def source_type(
    message: source_pb2.Source, readers: Sequence[RegisteredReader] = ()
) -> type[Source] | None:
    """Return what :func:`source` makes of a sketch or a map; None where nobody knows."""
    try:
        kind = file_kind(message, "", readers)
    except InvalidInputError:
        return None
    return _TYPES.get(message.WhichOneof("kind") or "") if kind is None else kind.source


def file_kind(
    message: source_pb2.Source, field: str, readers: Sequence[RegisteredReader]
) -> FileKind | None:
    """Return what kind of file a source is; None if it is none.

    Raises
    ------
    InvalidInputError
        If it is of no known kind, with a path that begins with ``field``.
    """
    if message.WhichOneof("kind") != "file":
        return None
    try:
        return kind_of_file(message.file.name, message.file.data, readers)
    except InvalidInputError as error:
        raise error.within(f"{field}.file") from None


def time_budget(request: _Matching, limits: RequestLimits) -> float | None:
    """Read how many seconds a match may take, or None for no limit.

    Raises
    ------
    InvalidInputError
        If it is no time.
    """
    if not request.HasField("time_budget"):
        return limits.time_budget(None)
    seconds = request.time_budget.seconds + request.time_budget.nanos / 1e9
    if seconds <= 0:
        raise InvalidInputError(
            Reason.INVALID_FIELD,
            "time_budget",
            f"is {seconds:g} s; give a positive time or none at all",
        )
    return limits.time_budget(seconds)


@contextmanager
def paths_of(
    request: _Matching | scene_service_pb2.SegmentRequest | scene_service_pb2.PutSceneRequest,
) -> Iterator[None]:
    """Give errors of the engine, which knows decoded sources alone, the paths of a request."""
    try:
        yield
    except InvalidInputError as error:
        side, _, path = error.field.partition(".")
        given = getattr(request, side, None)
        kind = given.WhichOneof("kind") if isinstance(given, source_pb2.Source) else ""
        if kind == "file":
            place = path.partition(".")[2]
            path = f"file.{'data' if place in _WHOLE else place}".removesuffix(".")
        elif path == "image.pixels":
            path = "image.data"
        elif path == "occupancy_grid.cells" and kind == "map_server_map":
            path = "map_server_map.image"
        elif path.startswith("occupancy_grid.objects") and kind == "map_server_map":
            path = f"map_server_map.{path.partition('.')[2]}"
        field = f"{side}.{path}" if path else side
        raise InvalidInputError(error.reason, field, error.problem) from None


def _plain(value: struct_pb2.Value) -> Any:
    """Return a value as Python has it; protobuf's own way stumbles over NaN."""
    match value.WhichOneof("kind"):
        case "struct_value":
            return {name: _plain(item) for name, item in value.struct_value.fields.items()}
        case "list_value":
            return [_plain(item) for item in value.list_value.values]
        case "number_value" | "string_value" | "bool_value" as kind:
            return getattr(value, kind)
    return None


def _is_blank(value: struct_pb2.Value) -> bool:
    """Whether a value, or one within it, is of no kind: protobuf calls that an error."""
    match value.WhichOneof("kind"):
        case "struct_value":
            return any(map(_is_blank, value.struct_value.fields.values()))
        case "list_value":
            return any(map(_is_blank, value.list_value.values))
        case kind:
            return kind is None


def _weights(message: match_pb2.ConfidenceWeights) -> ConfidenceWeights:
    """Read weights, of which any can be left out."""
    return ConfidenceWeights(**{field.name: value for field, value in message.ListFields()})


def pin(message: match_service_pb2.Pin, field: str) -> Pin:
    """Read what is known of an object; ``field`` is the path of it.

    Raises
    ------
    InvalidInputError
        If it names no object of the sketch.
    """
    sketched = _reference(message.sketch_object, f"{field}.sketch_object")
    mapped = None
    if message.HasField("map_object"):
        mapped = _reference(message.map_object, f"{field}.map_object")
    return Pin(sketched, mapped, message.excluded)


def _reference(message: match_service_pb2.ObjectReference, field: str) -> int | str:
    kind = message.WhichOneof("kind")
    if kind is None:
        raise InvalidInputError(Reason.MISSING_FIELD, field, "is not set; give index or label")
    return message.index if kind == "index" else message.label


def _features(request: transfer_service_pb2.TransferRequest) -> tuple[Feature, ...]:
    given = request.features
    lines = (each.route.points for each in given)
    rings = (ring.points for each in given for ring in each.zone.rings)
    check_vertices(sum(map(len, lines)) + sum(map(len, rings)), "features")
    upward = upward_of(request.y_axis)
    return tuple(_feature(each, f"features[{k}]", upward) for k, each in enumerate(given))


def _feature(message: transfer_service_pb2.Feature, field: str, upward: float) -> Feature:
    kind = message.WhichOneof("kind")
    if kind is None:
        raise InvalidInputError(
            Reason.MISSING_FIELD, field, "is not set; give point, route or zone"
        )
    speeds = None
    if kind == "point":
        rings = [_points([message.point], upward)]
    elif kind == "route":
        rings = [_points(message.route.points, upward)]
        if message.route.speeds_meters_per_second:
            speeds = np.array(message.route.speeds_meters_per_second)
    else:
        rings = [_points(ring.points, upward) for ring in message.zone.rings]
    try:
        return Feature(FeatureKind(kind), tuple(rings), message.name, speeds)
    except InvalidInputError as error:
        path = "speeds_meters_per_second" if error.field == "speeds" else error.field
        path = f"{field}.{kind}" if kind == "point" else f"{field}.{kind}.{path}"
        raise InvalidInputError(error.reason, path, error.problem) from None


def _stroke_set(message: source_pb2.StrokeSet) -> StrokeSet:
    check_vertices(sum(len(stroke.points) for stroke in message.strokes), "")
    upward = upward_of(message.y_axis)
    strokes = []
    for k, stroke in enumerate(message.strokes):
        points = _points(stroke.points, upward)
        times = _times(stroke, f"strokes[{k}]")
        strokes.append(Stroke(points, times, stroke.label))
    return StrokeSet(tuple(strokes))


def _times(stroke: source_pb2.Stroke, field: str) -> FloatArray | None:
    timed = [point.HasField("time_seconds") for point in stroke.points]
    if not any(timed):
        return None
    if not all(timed):
        raise InvalidInputError(
            Reason.INVALID_STROKE,
            f"{field}.points[{timed.index(False)}].time_seconds",
            "is not set, though other points have it; set it on every point or on none",
        )
    return np.array([point.time_seconds for point in stroke.points])


def _polygon_set(message: source_pb2.PolygonSet) -> PolygonSet:
    check_objects(len(message.polygons), "")
    given = [(polygon, [ring.points for ring in polygon.rings]) for polygon in message.polygons]
    rings = [ring for _, own in given for ring in own]
    ends = list(itertools.accumulate(map(len, rings), initial=0))
    check_vertices(ends[-1], "")
    # All points in one array: for few of them an array each takes longer than reading them.
    points = _points(itertools.chain.from_iterable(rings), upward_of(message.y_axis))
    read = (points[a:b] for a, b in itertools.pairwise(ends))
    return PolygonSet(
        tuple(
            LabelledPolygon(
                tuple(itertools.islice(read, len(own))),
                polygon.label,
                polygon.certainty if polygon.HasField("certainty") else 1.0,
            )
            for polygon, own in given
        )
    )


def _occupancy_grid(message: source_pb2.OccupancyGrid) -> OccupancyGrid:
    rows, columns = message.rows, message.columns
    check_pixels(columns, rows, "")
    if rows * columns != len(message.cells):
        raise InvalidInputError(
            Reason.INVALID_GRID,
            "cells",
            f"has {len(message.cells)} bytes for {rows} × {columns} cells; give one byte a cell",
        )
    cells = np.frombuffer(message.cells, dtype=np.int8).reshape(rows, columns)
    origin = message.origin
    pose = (origin.x_meters, origin.y_meters, origin.yaw_radians)
    try:
        return OccupancyGrid(cells, message.resolution_meters, pose)
    except InvalidInputError as error:
        if error.field == "resolution":
            raise InvalidInputError(error.reason, "resolution_meters", error.problem) from None
        raise


def _points(
    points: Iterable[source_pb2.Point] | Iterable[source_pb2.StrokePoint], upward: float
) -> FloatArray:
    flat = [value for point in points for value in (point.x, point.y)]
    read = np.array(flat, dtype=np.float64).reshape(-1, 2)
    if upward < 0.0:
        read[:, 1] *= upward
    return read


def upward_of(y_axis: int) -> float:
    """Return by what y is multiplied so that it grows upwards.

    Raises
    ------
    InvalidInputError
        If it is none of the contract.
    """
    _check_known("y_axis", y_axis, source_pb2.YAxis.DESCRIPTOR)
    return _UPWARD[y_axis]


def _check_known(field: str, value: int, kind: EnumDescriptor) -> None:
    """Refuse a value that an enumeration of the contract does not have."""
    if value not in kind.values_by_number:
        names = " or ".join(each.name for each in kind.values if each.number)
        problem = f"is {value}, which this server does not know; give {names}"
        raise InvalidInputError(Reason.INVALID_FIELD, field, problem)
