"""From the engine's values to response messages."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
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
    Ambiguity,
    Correspondence,
    MatchResult,
    ObjectMatch,
    ObjectRelation,
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
    from sketchmatch.app.tasks import Record

__all__ = [
    "ResponseWriter",
    "catalogue",
    "details",
    "fmap_entry",
    "result",
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
        match event:
            case Accepted():
                return match_service_pb2.MatchResponse(accepted=self._accepted(event))
            case Segmented():
                self._labels = (event.sketch.scene.labels, event.map.scene.labels)
                return match_service_pb2.MatchResponse(scenes=_scenes(event))
            case Progress():
                return match_service_pb2.MatchResponse(progress=self._progress(event))
            case Finished():
                return match_service_pb2.MatchResponse(result=result(event.result))

    def _accepted(self, event: Accepted) -> match_pb2.MatchAccepted:
        stages = {stage: selection(item) for stage, item in event.pipeline.stages().items()}
        budget = self._request.time_budget
        return match_pb2.MatchAccepted(
            match_id=event.match_id,
            seed=event.seed,
            pipeline=pipeline_pb2.Pipeline(**stages, profile=event.pipeline.profile),
            weights=_weights(event.weights),
            time_budget=None if budget is None else _duration(budget),
            unmatched_price=event.unmatched_price,
        )

    def _progress(self, event: Progress) -> match_pb2.MatchProgress:
        return match_pb2.MatchProgress(
            phase=match_pb2.Phase.Value(f"PHASE_{event.phase}"),
            fraction=event.fraction,
            iteration=event.iteration,
            evaluations=event.evaluations,
            confidence=event.confidence,
            upper_bound=event.upper_bound,
            object_matches=_object_matches(event.matches, *self._labels),
            elapsed=_duration(event.elapsed),
        )


def result(value: MatchResult) -> match_pb2.MatchResult:
    """Return a result as a message."""
    seconds = value.statistics.seconds
    return match_pb2.MatchResult(
        match_id=value.match_id,
        seed=value.seed,
        outcome=match_pb2.Outcome.Value(f"OUTCOME_{value.outcome}"),
        object_matches=_object_matches(value.matches, value.sketch.labels, value.map.labels),
        unmatched_sketch_objects=value.unmatched_sketch_objects,
        unmatched_map_objects=value.unmatched_map_objects,
        omap_confidence=value.omap_confidence,
        fmap_confidence=_fmap_confidence(value.confidence),
        upper_bound=value.upper_bound,
        fmap_entries=[fmap_entry(entry) for entry in value.fmap],
        rotation_radians=value.rotation,
        scale=value.scale,
        statistics=match_pb2.MatchStatistics(
            iterations=value.statistics.iterations,
            evaluations=value.statistics.evaluations,
            **{f"{stage}_elapsed": _duration(spent) for stage, spent in seconds.items()},
        ),
        alternatives=[
            match_pb2.AlternativeMap(
                object_matches=_object_matches(
                    other.matches, value.sketch.labels, value.map.labels
                ),
                fmap_confidence=_fmap_confidence(other.confidence),
                omap_confidence=other.omap_confidence,
                probability=other.probability,
            )
            for other in value.alternatives
        ],
        search_note=value.search_note,
        probability=value.probability,
        place_probability=value.place_probability,
        ambiguity=_ambiguity(value.ambiguity),
        unmatched_sketch_probabilities=value.unmatched_sketch_probabilities,
        provisional=value.provisional,
        object_groups=[
            match_pb2.ObjectGroup(
                sketch_objects=group.sketch_objects,
                map_objects=group.map_objects,
                probability=group.probability,
            )
            for group in value.groups
        ],
    )


def fmap_entry(entry: Correspondence) -> match_pb2.FmapEntry:
    """Return a line of a histogram map as a message."""
    (a, b), (c, d) = entry.sketch_pair, entry.map_pair
    return match_pb2.FmapEntry(
        sketch_pair=match_pb2.ObjectPair(first=a, second=b),
        map_pair=match_pb2.ObjectPair(first=c, second=d),
        similarity=entry.similarity,
        rotation_radians=entry.rotation,
        dilation=entry.dilation,
    )


@lru_cache(maxsize=32)
def scene(value: Scene) -> scene_pb2.Scene:
    """Return a scene as a message, which is not to be changed: one is made of each scene."""
    return scene_pb2.Scene(objects=map(_scene_object, value.objects))


@lru_cache(maxsize=1024)
def _scene_object(item: SceneObject) -> scene_pb2.SceneObject:
    """Return an object as a message: the next revision of a sketch has most of them again."""
    return scene_pb2.SceneObject(
        rings=[source_pb2.Ring(points=_points(ring)) for ring in item.rings],
        label=item.label,
        area=item.area,
        centroid=source_pb2.Point(x=item.centroid[0], y=item.centroid[1]),
        certainty=item.certainty if item.certainty < 1.0 else None,
    )


def selection(value: Algorithm) -> pipeline_pb2.AlgorithmSelection:
    """Return an algorithm with all its parameters as a message."""
    message = pipeline_pb2.AlgorithmSelection(name=value.name)
    message.parameters.update(value.params.model_dump(mode="json"))
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


def _scenes(event: Segmented) -> match_pb2.MatchScenes:
    return match_pb2.MatchScenes(
        sketch=scene(event.sketch.scene),
        map=scene(event.map.scene),
        sketch_warnings=event.sketch.warnings,
        map_warnings=event.map.warnings,
        sketch_route=_points(event.sketch.route),
    )


def _points(points: FloatArray | None) -> list[source_pb2.Point]:
    return [] if points is None else [source_pb2.Point(x=x, y=y) for x, y in points.tolist()]


def _object_matches(
    matches: Iterable[ObjectMatch], sketch_labels: Sequence[str], map_labels: Sequence[str]
) -> list[match_pb2.ObjectMatch]:
    return [
        match_pb2.ObjectMatch(
            sketch_object=match.sketch_object,
            map_object=match.map_object,
            sketch_label=sketch_labels[match.sketch_object],
            map_label=map_labels[match.map_object],
            confidence=match.confidence,
            margin=match.margin,
            relation=_relation(match.relation),
            probability=match.probability,
        )
        for match in matches
    ]


def _relation(relation: ObjectRelation | None) -> match_pb2.ObjectRelation | None:
    if relation is None:
        return None
    return match_pb2.ObjectRelation(
        reference_object=relation.reference_object,
        phrase=relation.phrase,
        degree=relation.degree,
    )


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


_UNFORESEEN = "the server failed in a way nobody foresaw"


def _is_ours(error: BaseException) -> bool:
    return not isinstance(error, SketchmatchError)


def _timestamp(seconds: float) -> Timestamp:
    stamp = Timestamp()
    stamp.FromMicroseconds(round(seconds * 1e6))  # more a float does not hold
    return stamp


def _ambiguity(value: Ambiguity | None) -> match_pb2.Ambiguity | None:
    if value is None:
        return None
    return match_pb2.Ambiguity(
        maps=value.maps,
        alternatives=value.alternatives,
        deciding_sketch_objects=value.deciding_sketch_objects,
    )


def _fmap_confidence(confidence: Confidence) -> match_pb2.FmapConfidence:
    return match_pb2.FmapConfidence(
        total=confidence.total,
        similarity=confidence.similarity,
        rotation=confidence.rotation,
        dilation=confidence.dilation,
        shape=confidence.shape,
        size=confidence.size,
    )


def _weights(weights: RequestWeights) -> match_pb2.ConfidenceWeights:
    return match_pb2.ConfidenceWeights(**ConfidenceWeights(*weights)._asdict())


def _duration(seconds: float) -> Duration:
    duration = Duration()
    duration.FromNanoseconds(round(seconds * 1e9))
    return duration


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
    return transfer_service_pb2.TransferResponse(
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
        scenes=_scenes(Segmented(value.sketch, value.map)),
        match=None if value.match is None else result(value.match),
    )


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
