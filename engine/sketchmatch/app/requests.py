"""From request messages to the engine's values."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from google.protobuf import struct_pb2

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
from sketchmatch_proto.v1 import (
    match_pb2,
    match_service_pb2,
    pipeline_pb2,
    scene_service_pb2,
    source_pb2,
)

__all__ = [
    "choice",
    "file_kind",
    "match_request",
    "paths_of",
    "selection",
    "source",
    "source_type",
    "time_budget",
]

_KINDS = "stroke_set, polygon_set, occupancy_grid, map_server_map, image or file"
_OPTIONS = ("alternatives", "allow_unmatched", "unmatched_price")
"""Fields that mean the same as those of that name in the engine's request."""
_WHOLE = ("pixels", "cells")
"""What errors call a picture or a grid as a whole."""
_TYPES: dict[str, type[Source]] = {
    "stroke_set": StrokeSet,
    "polygon_set": PolygonSet,
    "occupancy_grid": OccupancyGrid,
    "map_server_map": OccupancyGrid,
    "image": Image,
}


def match_request(
    request: match_service_pb2.MatchRequest,
    limits: RequestLimits,
    readers: Sequence[RegisteredReader] = (),
) -> MatchRequest:
    """Read a request to match, within some limits; ``readers`` are those of plugins.

    Raises
    ------
    InvalidInputError
        If it cannot be used, with the path of the field.
    """
    return MatchRequest(
        sketch=source(request.sketch, "sketch", request.HasField("sketch"), readers),
        map=source(request.map, "map", request.HasField("map"), readers),
        selection=selection(request),
        seed=request.seed,
        time_budget=time_budget(request, limits),
        weights=_weights(request.weights) if request.HasField("weights") else None,
        profile=request.pipeline.profile,
        pins=tuple(_pin(pin, f"pins[{k}]") for k, pin in enumerate(request.pins)),
        synonyms=tuple(tuple(group.labels) for group in request.synonyms),
        **{field.name: value for field, value in request.ListFields() if field.name in _OPTIONS},
    )


def selection(request: match_service_pb2.MatchRequest) -> Selection:
    """Read what is asked for in each stage."""
    return {stage: choice(getattr(request.pipeline, stage)) for stage in STAGES}


def choice(message: pipeline_pb2.AlgorithmSelection) -> Choice:
    """Read what is asked for in one stage."""
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
                return decode_map_server(packed.yaml, packed.image, packed.objects)
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
    kind = file_kind(message, readers)
    return _TYPES.get(message.WhichOneof("kind") or "") if kind is None else kind.source


def file_kind(message: source_pb2.Source, readers: Sequence[RegisteredReader]) -> FileKind | None:
    """Return what kind of file a source is; None if it is none, or of no known kind."""
    if message.WhichOneof("kind") != "file":
        return None
    try:
        return kind_of_file(message.file.name, message.file.data, readers)
    except InvalidInputError:
        return None


def time_budget(request: match_service_pb2.MatchRequest, limits: RequestLimits) -> float | None:
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
    request: match_service_pb2.MatchRequest | scene_service_pb2.SegmentRequest,
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


def _weights(message: match_pb2.ConfidenceWeights) -> ConfidenceWeights:
    """Read weights, of which any can be left out."""
    return ConfidenceWeights(**{field.name: value for field, value in message.ListFields()})


def _pin(message: match_service_pb2.Pin, field: str) -> Pin:
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


def _stroke_set(message: source_pb2.StrokeSet) -> StrokeSet:
    check_vertices(sum(len(stroke.points) for stroke in message.strokes), "")
    upward = _upward(message.y_axis)
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
    rings = (ring for polygon in message.polygons for ring in polygon.rings)
    check_vertices(sum(len(ring.points) for ring in rings), "")
    upward = _upward(message.y_axis)
    return PolygonSet(
        tuple(
            LabelledPolygon(
                tuple(_points(ring.points, upward) for ring in polygon.rings),
                polygon.label,
                polygon.certainty if polygon.HasField("certainty") else 1.0,
            )
            for polygon in message.polygons
        )
    )


def _occupancy_grid(message: source_pb2.OccupancyGrid) -> OccupancyGrid:
    rows, columns = message.rows, message.columns
    check_pixels(columns, rows, "")
    if rows * columns != len(message.cells):
        raise InvalidInputError(
            Reason.INVALID_GRID,
            "cells",
            f"has {len(message.cells)} bytes for {rows} × {columns} cells; give one for each cell",
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
    flat = [value for point in points for value in (point.x, upward * point.y)]
    return np.array(flat, dtype=np.float64).reshape(-1, 2)


def _upward(y_axis: int) -> float:
    return -1.0 if y_axis == source_pb2.Y_AXIS_DOWN else 1.0
