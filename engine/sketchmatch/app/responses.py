"""From the engine's values to response messages."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

from google.protobuf.duration_pb2 import Duration
from google.protobuf.timestamp_pb2 import Timestamp

import sketchmatch
from sketchmatch.api import API_VERSION, Algorithm, Segmentation, Segmenter
from sketchmatch.app.setup import Setup
from sketchmatch.errors import SketchmatchError
from sketchmatch.model import (
    Confidence,
    ConfidenceWeights,
    FloatArray,
    Image,
    OccupancyGrid,
    PolygonSet,
    RequestWeights,
    Scene,
    SceneObject,
    StrokeSet,
)
from sketchmatch.pipeline.events import Accepted, Finished, MatchEvent, Progress, Segmented
from sketchmatch.pipeline.request import MatchRequest
from sketchmatch.pipeline.result import (
    Correspondence,
    MatchResult,
    ObjectMatch,
)
from sketchmatch.pipeline.selection import (
    UNCONFIGURED,
    Choice,
    Defaults,
    Profile,
    default_names,
    default_parameters,
)
from sketchmatch.registry import Kind, PluginStatus, Registered, RegisteredReader, Registry
from sketchmatch.transfers.features import Carried, Feature, FeatureKind
from sketchmatch.transfers.transfer import TransferResult
from sketchmatch_proto.v1 import (
    catalog_service_pb2,
    match_pb2,
    match_service_pb2,
    pipeline_pb2,
    scene_pb2,
    scene_service_pb2,
    source_pb2,
    transfer_service_pb2,
)

if TYPE_CHECKING:
    from google.protobuf.internal.containers import RepeatedCompositeFieldContainer as _Repeated

    from sketchmatch.app.tasks import Record

__all__ = [
    "ResponseWriter",
    "catalogue",
    "details",
    "fmap_entry",
    "scene",
    "segmented",
    "selection",
    "server_info",
    "stored_scene",
    "summary",
    "transferred",
]

_SOURCE_KINDS = {
    StrokeSet: [catalog_service_pb2.SOURCE_KIND_STROKE_SET],
    PolygonSet: [catalog_service_pb2.SOURCE_KIND_POLYGON_SET],
    OccupancyGrid: [
        catalog_service_pb2.SOURCE_KIND_OCCUPANCY_GRID,
        catalog_service_pb2.SOURCE_KIND_MAP_SERVER_MAP,
    ],
    Image: [catalog_service_pb2.SOURCE_KIND_IMAGE],
}


_MANY_POINTS = 16
"""Of an object: what has fewer is sooner written than looked for among those written before."""


class ResponseWriter:
    """Turns the events of one match into responses.

    Parameters
    ----------
    request
        What is matched.
    """

    def __init__(self, request: MatchRequest) -> None:
        self._request = request
        self._labels: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())

    def response(self, event: MatchEvent) -> match_service_pb2.MatchResponse:
        """Return the response for the next event."""
        # Written in place: a message that is handed over is copied, once at every level.
        response = match_service_pb2.MatchResponse()
        match event:
            case Accepted():
                self._write_accepted(response.accepted, event)
            case Segmented():
                self._labels = (event.sketch.scene.labels, event.map.scene.labels)
                _write_scenes(response.scenes, event)
            case Progress():
                self._write_progress(response.progress, event)
            case Finished():
                _write_result(response.result, event.result)
        return response

    def _write_accepted(self, message: match_pb2.MatchAccepted, event: Accepted) -> None:
        message.match_id = event.match_id
        message.seed = event.seed
        message.pipeline.profile = event.pipeline.profile
        for stage, item in event.pipeline.stages().items():
            getattr(message.pipeline, stage).CopyFrom(selection(item))
        message.weights.CopyFrom(_weights(event.weights))
        if (budget := self._request.time_budget) is not None:
            _write_duration(message.time_budget, budget)
        message.allow_unmatched = event.unmatched_price is not None
        if event.unmatched_price is not None:
            message.unmatched_price = event.unmatched_price

    def _write_progress(self, message: match_pb2.MatchProgress, event: Progress) -> None:
        message.phase = _phase(event.phase)
        message.iteration = event.iteration
        message.evaluations = event.evaluations
        for name in ("fraction", "confidence", "upper_bound"):
            if (value := getattr(event, name)) is not None:
                setattr(message, name, value)
        _write_duration(message.elapsed, event.elapsed)
        _add_object_matches(message.object_matches, event.matches, self._labels)


def _write_result(message: match_pb2.MatchResult, value: MatchResult) -> None:
    labels = value.sketch.labels, value.map.labels
    message.match_id = value.match_id
    message.seed = value.seed
    message.outcome = _outcome(value.outcome)
    _add_object_matches(message.object_matches, value.matches, labels)
    message.unmatched_sketch_objects.extend(value.unmatched_sketch_objects)
    message.unmatched_map_objects.extend(value.unmatched_map_objects)
    message.omap_confidence = value.omap_confidence
    _write_fmap_confidence(message.fmap_confidence, value.confidence)
    for entry in value.fmap:
        _write_fmap_entry(message.fmap_entries.add(), entry)
    message.rotation_radians = value.rotation
    message.scale = value.scale
    message.statistics.iterations = value.statistics.iterations
    message.statistics.evaluations = value.statistics.evaluations
    for stage, spent in value.statistics.seconds.items():
        _write_duration(getattr(message.statistics, f"{stage}_elapsed"), spent)
    for other in value.alternatives:
        alternative = message.alternatives.add(
            omap_confidence=other.omap_confidence, probability=other.probability
        )
        _write_fmap_confidence(alternative.fmap_confidence, other.confidence)
        _add_object_matches(alternative.object_matches, other.matches, labels)
    message.search_note = value.search_note
    for name in ("upper_bound", "probability", "place_probability"):
        if (known := getattr(value, name)) is not None:
            setattr(message, name, known)
    if (open_ := value.ambiguity) is not None:
        message.ambiguity.maps = open_.maps
        message.ambiguity.alternatives.extend(open_.alternatives)
        message.ambiguity.deciding_sketch_objects.extend(open_.deciding_sketch_objects)
    message.unmatched_sketch_probabilities.extend(value.unmatched_sketch_probabilities)
    message.provisional = value.provisional
    for group in value.groups:
        message.object_groups.add(
            sketch_objects=group.sketch_objects,
            map_objects=group.map_objects,
            probability=group.probability,
        )


def fmap_entry(entry: Correspondence) -> match_pb2.FmapEntry:
    """Return a line of a histogram map as a message."""
    message = match_pb2.FmapEntry()
    _write_fmap_entry(message, entry)
    return message


def _write_fmap_entry(message: match_pb2.FmapEntry, entry: Correspondence) -> None:
    sketch_pair, map_pair = message.sketch_pair, message.map_pair
    sketch_pair.first, sketch_pair.second = entry.sketch_pair
    map_pair.first, map_pair.second = entry.map_pair
    message.similarity = entry.similarity
    message.rotation_radians = entry.rotation
    message.dilation = entry.dilation


@lru_cache(maxsize=32)
def scene(value: Scene) -> scene_pb2.Scene:
    """Return a scene as a message, which is not to be changed: one is made of each scene."""
    message = scene_pb2.Scene()
    for item in value.objects:
        if sum(map(len, item.rings)) < _MANY_POINTS:
            _write_scene_object(message.objects.add(), item)
        else:
            message.objects.append(_scene_object(item))
    return message


@lru_cache(maxsize=1024)
def _scene_object(item: SceneObject) -> scene_pb2.SceneObject:
    """Return an object as a message: the next revision of a sketch has most of them again."""
    message = scene_pb2.SceneObject()
    _write_scene_object(message, item)
    return message


def _write_scene_object(message: scene_pb2.SceneObject, item: SceneObject) -> None:
    message.label = item.label
    message.area = item.area
    message.centroid.x, message.centroid.y = item.centroid
    if item.certainty < 1.0:
        message.certainty = item.certainty
    for ring in item.rings:
        _add_points(message.rings.add().points, ring)


def selection(value: Algorithm) -> pipeline_pb2.AlgorithmSelection:
    """Return an algorithm with all its parameters as a message."""
    return _selection(value.name, value.params.model_dump_json())


@lru_cache(maxsize=256)
def _selection(name: str, parameters: str) -> pipeline_pb2.AlgorithmSelection:
    """Return a message, not to be changed, as most requests choose the same."""
    message = pipeline_pb2.AlgorithmSelection(name=name)
    message.parameters.update(json.loads(parameters))
    return message


def segmented(
    found: Segmentation, segmenter: Segmenter, map_: source_pb2.MapServerMap | None = None
) -> scene_service_pb2.SegmentResponse:
    """Return what a segmenter found as a message, with its map where that is wanted."""
    return scene_service_pb2.SegmentResponse(
        scene=scene(found.scene),
        warnings=found.warnings,
        segmenter=selection(segmenter),
        route=_points(found.route),
        passages=_passages(found),
        map=map_,
    )


def stored_scene(
    name: str, found: Segmentation, segmenter: Segmenter | None = None
) -> scene_service_pb2.StoredScene:
    """Return what a segmenter found as the record that is kept of it."""
    return scene_service_pb2.StoredScene(
        name=name,
        scene=scene(found.scene),
        warnings=found.warnings,
        segmenter=None if segmenter is None else selection(segmenter),
        route=_points(found.route),
        passages=_passages(found),
    )


def _passages(found: Segmentation) -> list[scene_service_pb2.Passage]:
    return [scene_service_pb2.Passage(first=a, second=b) for a, b in found.passages]


def catalogue(
    registry: Registry, defaults: Defaults = UNCONFIGURED
) -> catalog_service_pb2.ListAlgorithmsResponse:
    """Return what a registry holds, with the defaults in force, as a message."""
    names = default_names(registry, defaults)
    profiles = sorted(defaults.profiles, key=lambda profile: profile.name)
    return catalog_service_pb2.ListAlgorithmsResponse(
        algorithms=[
            _algorithm(item, default_parameters(registry, defaults, item), item.name in names[kind])
            for kind in Kind
            for item in registry.of_kind(kind)
        ],
        plugins=[_plugin(status) for status in registry.statuses],
        profiles=[_profile(profile, profile.name == defaults.profile) for profile in profiles],
        readers=[_reader(item) for item in registry.readers],
    )


def server_info(
    setup: Setup, uptime: float, keeps_scenes: bool
) -> catalog_service_pb2.GetServerInfoResponse:
    """Return versions, limits and what the server keeps as a message; ``uptime`` in seconds."""
    given = setup.limits
    limits = catalog_service_pb2.ServerLimits(
        max_request_bytes=given.max_request_bytes,
        max_objects=setup.engine.limits.max_objects,
        max_concurrent_matches=given.max_concurrent_matches,
    )
    limits.max_waiting = given.max_waiting
    limits.max_waiting_bytes = given.max_waiting_bytes
    limits.max_wait.FromMilliseconds(round(1e3 * given.max_wait))
    if given.max_time_budget is not None:
        limits.max_time_budget.FromMilliseconds(round(1e3 * given.max_time_budget))
    if given.default_time_budget is not None:
        usual = given.time_budget(None) or given.default_time_budget
        limits.default_time_budget.FromMilliseconds(round(1e3 * usual))
    for name, value in (
        ("max_matches_per_caller", given.max_per_caller),
        ("max_requests_per_minute", given.max_per_minute),
        ("max_comparisons", given.max_comparisons),
        ("max_candidates", given.max_candidates),
    ):
        if value is not None:
            setattr(limits, name, value)
    return catalog_service_pb2.GetServerInfoResponse(
        version=sketchmatch.__version__,
        api_version="sketchmatch.v1",
        plugin_api_version=API_VERSION,
        limits=limits,
        uptime=Duration(seconds=int(uptime)),
        keeps_scenes=keeps_scenes,
    )


def _write_scenes(message: match_pb2.MatchScenes, event: Segmented) -> None:
    message.sketch.CopyFrom(scene(event.sketch.scene))
    message.map.CopyFrom(scene(event.map.scene))
    message.sketch_warnings.extend(event.sketch.warnings)
    message.map_warnings.extend(event.map.warnings)
    if event.sketch.route is not None:
        _add_points(message.sketch_route, event.sketch.route)


def _add_points(message: _Repeated[source_pb2.Point], points: FloatArray) -> None:
    add = message.add
    for x, y in points.tolist():
        add(x=x, y=y)


def _points(points: FloatArray | None) -> list[source_pb2.Point]:
    return [] if points is None else [source_pb2.Point(x=x, y=y) for x, y in points.tolist()]


def _add_object_matches(
    message: _Repeated[match_pb2.ObjectMatch],
    matches: Iterable[ObjectMatch],
    labels: tuple[Sequence[str], Sequence[str]],
) -> None:
    sketch_labels, map_labels = labels
    for match in matches:
        line = message.add(
            sketch_object=match.sketch_object,
            map_object=match.map_object,
            sketch_label=sketch_labels[match.sketch_object],
            map_label=map_labels[match.map_object],
            confidence=match.confidence,
            margin=match.margin,
            probability=match.probability,
        )
        if (seen := match.relation) is not None:
            relation = line.relation
            relation.reference_object = seen.reference_object
            relation.phrase = seen.phrase
            relation.degree = seen.degree


def summary(record: Record) -> match_service_pb2.MatchSummary:
    """Return what is known of a match."""
    error = record.error
    return match_service_pb2.MatchSummary(
        match_id=record.id,
        request_id=record.wish.request_id,
        state=match_service_pb2.MatchState.ValueType(record.state),
        created_at=_timestamp(record.created),
        ended_at=None if record.ended is None else _timestamp(record.ended),
        outcome=match_pb2.Outcome.ValueType(record.outcome),
        last_event=record.events[-1][0] if record.events else 0,
        error_message="" if error is None else _UNFORESEEN if _is_ours(error) else str(error),
        error_reason=getattr(error, "reason", ""),
    )


def details(record: Record) -> match_service_pb2.GetMatchResponse:
    """Return what is known of a match, with its events."""
    response = match_service_pb2.GetMatchResponse(match=summary(record))
    for number, encoded in record.events:
        event = response.events.add()
        event.ParseFromString(encoded)
        event.number = number
    return response


_UNFORESEEN = "the server failed with an unexpected error"


def _is_ours(error: BaseException) -> bool:
    return not isinstance(error, SketchmatchError)


def _timestamp(seconds: float) -> Timestamp:
    stamp = Timestamp()
    stamp.FromMicroseconds(round(seconds * 1e6))  # more a float does not hold
    return stamp


def _write_fmap_confidence(message: match_pb2.FmapConfidence, confidence: Confidence) -> None:
    message.total = confidence.total
    message.similarity = confidence.similarity
    message.rotation = confidence.rotation
    message.dilation = confidence.dilation
    if confidence.shape is not None:
        message.shape = confidence.shape
    if confidence.size is not None:
        message.size = confidence.size


def _weights(weights: RequestWeights) -> match_pb2.ConfidenceWeights:
    return match_pb2.ConfidenceWeights(**ConfidenceWeights(*weights)._asdict())


@cache
def _outcome(value: str) -> match_pb2.Outcome.ValueType:
    return match_pb2.Outcome.Value(f"OUTCOME_{value}")


@cache
def _phase(value: str) -> match_pb2.Phase.ValueType:
    return match_pb2.Phase.Value(f"PHASE_{value}")


def _write_duration(message: Duration, seconds: float) -> None:
    message.seconds, message.nanos = divmod(round(seconds * 1e9), 1_000_000_000)


def _profile(profile: Profile, is_default: bool) -> catalog_service_pb2.Profile:
    stages: dict[str, Any] = {stage: _choice(choice) for stage, choice in profile.stages.items()}
    return catalog_service_pb2.Profile(
        name=profile.name,
        summary=profile.summary,
        pipeline=pipeline_pb2.Pipeline(**stages),
        is_default=is_default,
        weights=None if profile.weights is None else _weights(profile.weights),
        allow_unmatched=bool(profile.allow_unmatched),
    )


def _choice(choice: Choice) -> pipeline_pb2.AlgorithmSelection:
    message = pipeline_pb2.AlgorithmSelection(name=choice.name)
    if choice.parameters:
        message.parameters.update(choice.parameters)
    return message


def _algorithm(
    item: Registered, parameters: Mapping[str, Any], is_default: bool
) -> catalog_service_pb2.Algorithm:
    message = catalog_service_pb2.Algorithm(
        kind=catalog_service_pb2.AlgorithmKind.Value(f"ALGORITHM_KIND_{item.kind.upper()}"),
        name=item.name,
        summary=item.algorithm.summary,
        description=item.description,
        distribution=item.distribution,
        distribution_version=item.version,
        is_default=is_default,
        source=item.source,
    )
    schema = item.schema
    for name, field in schema.get("properties", {}).items():
        field["default"] = parameters.get(name, field["default"])
    message.parameters_schema.update(schema)
    if issubclass(item.algorithm, Segmenter):
        for kind in item.algorithm.sources:
            message.source_kinds.extend(_source_kinds(kind))
    return message


def _source_kinds(source: type[Any]) -> list[catalog_service_pb2.SourceKind.ValueType]:
    """Return the forms of a type of source, or of what a plugin made of it."""
    return next(_SOURCE_KINDS[base] for base in source.__mro__ if base in _SOURCE_KINDS)


def _reader(item: RegisteredReader) -> catalog_service_pb2.FileReader:
    return catalog_service_pb2.FileReader(
        name=item.name,
        summary=item.reader.summary,
        suffixes=item.reader.suffixes,
        json_keys=item.reader.keys,
        source_kind=_source_kinds(item.reader.source)[0],
        distribution=item.distribution,
        distribution_version=item.version,
    )


def _plugin(status: PluginStatus) -> catalog_service_pb2.Plugin:
    return catalog_service_pb2.Plugin(
        distribution=status.distribution,
        version=status.version,
        state=catalog_service_pb2.PluginState.Value(f"PLUGIN_STATE_{status.state}"),
        reason=status.reason,
    )


def transferred(value: TransferResult) -> transfer_service_pb2.TransferResponse:
    """Return what became of a transfer as a message."""
    warp = value.warp
    message = transfer_service_pb2.TransferResponse(
        features=[_carried(each, k < value.drawn) for k, each in enumerate(value.carried)],
        warp=transfer_service_pb2.Warp(
            kind=transfer_service_pb2.WarpKind.Value(f"WARP_KIND_{warp.kind.name}"),
            rotation_radians=warp.rotation,
            scale=warp.scale,
            residual=warp.residual,
            weights=warp.weights,
        ),
        object_map=[
            transfer_service_pb2.Partners(sketch_object=a, map_object=b)
            for a, b in value.object_map
        ],
    )
    _write_scenes(message.scenes, Segmented(value.sketch, value.map))
    if value.match is not None:
        _write_result(message.match, value.match)
    return message


def _carried(value: Carried, drawn: bool) -> transfer_service_pb2.CarriedFeature:
    return transfer_service_pb2.CarriedFeature(
        feature=_feature(value.feature, value.name),
        lines=[
            transfer_service_pb2.CarriedPoints(deviations=deviations, sources=sources)
            for deviations, sources in zip(value.deviations, value.sources, strict=True)
        ],
        changes=[
            transfer_service_pb2.FeatureChange(
                reason=transfer_service_pb2.ChangeReason.Value(f"CHANGE_REASON_{each.reason.name}"),
                first_point=each.first,
                last_point=each.last,
                sentence=each.sentence,
            )
            for each in value.changes
        ],
        drawn=drawn,
    )


def _feature(value: Feature | None, name: str) -> transfer_service_pb2.Feature:
    message = transfer_service_pb2.Feature(name=name)
    if value is None:
        return message
    match value.kind:
        case FeatureKind.POINT:
            message.point.CopyFrom(_points(value.points)[0])
        case FeatureKind.ROUTE:
            message.route.points.extend(_points(value.points))
            if value.speeds is not None:
                message.route.speeds_meters_per_second.extend(value.speeds)
        case FeatureKind.ZONE:
            rings = [source_pb2.Ring(points=_points(ring)) for ring in value.rings]
            message.zone.rings.extend(rings)
    return message
