"""From plain Python values to requests."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, TypedDict, Unpack

from google.protobuf.duration_pb2 import Duration
from google.protobuf.struct_pb2 import Struct

from sketchmatch_client.errors import InvalidRequestError, refused_as
from sketchmatch_proto.v1 import match_service_pb2
from sketchmatch_proto.v1.match_pb2 import ConfidenceWeights
from sketchmatch_proto.v1.match_service_pb2 import MatchRequest, ObjectReference, Synonyms
from sketchmatch_proto.v1.pipeline_pb2 import AlgorithmSelection, Pipeline
from sketchmatch_proto.v1.scene_service_pb2 import SegmentRequest
from sketchmatch_proto.v1.source_pb2 import Source

__all__ = ["MatchOptions", "Pin", "match_request", "segment_request"]

Weights = (
    tuple[float, float, float]
    | tuple[float, float, float, float, float]
    | tuple[float, float, float, float, float, float]
)
"""Of similarity, rotation and dilation in ζ, perhaps of shape and size, and of distance in ζR."""


@dataclass(frozen=True)
class Pin:
    """What is known of a sketched object.

    Attributes
    ----------
    sketch
        The sketched object: its index, from 0, or its label, which no other one has.
    map
        The mapped object, in the same way; None if it is on no map and finds no partner.
    excluded
        Whether it is known that it is *not* this one: any other may be its partner, or none.
    """

    sketch: int | str
    map: int | str | None
    excluded: bool = False


Pins = Mapping[Any, int | str | None] | Iterable[Pin]
"""What is known of sketched objects."""

_STAGES = tuple(
    field.name
    for field in Pipeline.DESCRIPTOR.fields
    if field.message_type is AlgorithmSelection.DESCRIPTOR
)


class MatchOptions(TypedDict, total=False):
    """Options of a match; the server decides those that are not given.

    Attributes
    ----------
    sketch_segmenter, map_segmenter, histogram, similarity, searcher, judge
        Names of algorithms; :meth:`Client.algorithms` lists them.
    params
        Parameters by stage, e.g. ``{"searcher": {"population": 200}}``. The stages are the
        names of the six options above.
    seed
        Random seed, from 0 to 2**64 − 1; 0 by default.
    time_budget
        Seconds, or a timedelta, after which the best match so far is the result.
    weights
        Weights of similarity, rotation and dilation in ζ; two more are those of the objects' own
        shape and size; a sixth is the exponent β: the rotation of two objects at distance d counts
        d^β. By default those of the profile, or else 1, 1, 1, 0, 0, 0.
    allow_unmatched
        Whether objects may stay without partner on both sides where that is more likely. By default
        as the profile says, or else as searcher and judge do by themselves.
    unmatched_price
        Price of a match that leaves out all objects of the smaller scene, in units of ζ; in
        proportion if it leaves out some. By default the judge's own.
    alternatives
        Number of next best object maps in the result; 3 by default. There may be fewer.
    pins
        What is known of single objects, which the answer obeys: a dict from sketched objects to
        their partners, or to None for one that is not on the map, e.g. ``{"desk": 3, 0: "sofa", 5:
        None}``. Objects are given by index, from 0, or by a label that is unique in the scene. Or
        :class:`Pin` values, which can also state that one is *not* another.
    synonyms
        Labels that mean the same, besides those that differ only in case, plural or a counting
        number: ``[("couch", "sofa")]``. Labels are evidence, and never force a line.
    profile
        Name of one of the server's pipelines, e.g. ``"proof"``, to start from; the options above
        override it. By default the server's default one.
    request_id
        A name for the request, at most 128 bytes: sent again under the same name it is the same
        match, which runs once. By default the client makes one for each call.
    keep_running
        Whether the match continues when nobody reads it; :meth:`Client.watch` reads it again.
    priority
        ``"low"``, ``"normal"`` or ``"high"``: which of the caller's own waiting requests start
        first; normal by default.
    """

    sketch_segmenter: str | None
    map_segmenter: str | None
    histogram: str | None
    similarity: str | None
    searcher: str | None
    judge: str | None
    params: Mapping[str, Mapping[str, Any]] | None
    seed: int | None
    time_budget: float | timedelta | None
    weights: Weights | None
    allow_unmatched: bool | None
    unmatched_price: float | None
    alternatives: int | None
    pins: Pins | None
    synonyms: Iterable[Iterable[str]] | None
    profile: str | None
    request_id: str | None
    keep_running: bool | None
    priority: str | None


def match_request(
    sketch: Source,
    map: Source,  # noqa: A002
    **options: Unpack[MatchOptions],
) -> MatchRequest:
    """Return the request for a match; see :class:`MatchOptions`.

    Examples
    --------
    >>> match_request(Source(), Source(), searcher="easm", seed=7).pipeline.searcher.name
    'easm'
    """
    given: dict[str, Any] = {name: value for name, value in options.items() if value is not None}
    names = {stage: given.pop(stage) for stage in _STAGES if stage in given}
    pipeline = _pipeline(names, given.pop("params", {}))
    _set_profile(pipeline, given.pop("profile", ""))
    request = MatchRequest(
        sketch=_checked("sketch", sketch), map=_checked("map", map), pipeline=pipeline
    )
    for name, value in given.items():
        if name not in _FIELDS:
            raise TypeError(f"unknown option {name!r}; MatchOptions lists all options")
        remedy, converted = _FIELDS[name]
        with refused_as("INVALID_FIELD", name, f"is {reprlib.repr(value)}; {remedy}"):
            request.MergeFrom(MatchRequest(**{name: converted(value)}))
    return request


def segment_request(
    source: Source,
    segmenter: str | None = None,
    params: Mapping[str, Any] | None = None,
    profile: str | None = None,
    include_map: bool = False,
) -> SegmentRequest:
    """Return the request for the objects of one source; see :meth:`Client.segment`."""
    request = SegmentRequest(source=_checked("source", source), include_map=bool(include_map))
    _set_profile(request, profile or "")
    if segmenter or params:
        request.segmenter.CopyFrom(_selection("segmenter", segmenter or "", params or {}))
    return request


def _pipeline(names: Mapping[str, str], params: Mapping[str, Mapping[str, Any]]) -> Pipeline:
    if unknown := [stage for stage in _mapping("params", params) if stage not in _STAGES]:
        raise InvalidRequestError(
            f"params has no stage {unknown[0]!r}; the stages are {', '.join(_STAGES)}",
            "INVALID_FIELD",
            "pipeline",
        )
    stages: dict[str, Any] = {
        stage: _selection(f"pipeline.{stage}", names.get(stage) or "", params.get(stage, {}))
        for stage in _STAGES
        if names.get(stage) or params.get(stage)
    }
    return Pipeline(**stages)


def _selection(field: str, name: str, params: Mapping[str, Any]) -> AlgorithmSelection:
    with refused_as(
        "INVALID_FIELD", f"{field}.name", f"is {reprlib.repr(name)}; give the name of an algorithm"
    ):
        selection = AlgorithmSelection(name=name)
    if _mapping(f"{field}.parameters", params):
        struct = Struct()
        with refused_as("INVALID_FIELD", f"{field}.parameters", "holds a value that is not JSON"):
            struct.update(params)
        selection.parameters.CopyFrom(struct)
    return selection


def _mapping(field: str, given: Any) -> Mapping[str, Any]:
    if not isinstance(given, Mapping):
        raise InvalidRequestError(
            f"{field} is {reprlib.repr(given)}; give a dict", "INVALID_FIELD", field
        )
    return given


def _checked(field: str, given: Source) -> Source:
    if not isinstance(given, Source):
        raise InvalidRequestError(
            f"{field} is {reprlib.repr(given)}; "
            "make a source of it with sketchmatch_client.sources",
            "INVALID_FIELD",
            field,
        )
    return given


def _set_profile(message: Pipeline | SegmentRequest, profile: str) -> None:
    problem = f"is {reprlib.repr(profile)}; give the name of a profile"
    with refused_as("INVALID_FIELD", "profile", problem):
        message.profile = profile


def _weights(weights: Weights) -> ConfidenceWeights:
    if len(weights) not in (3, 5, 6):
        raise ValueError
    names = ("similarity", "rotation", "dilation", "shape", "size", "distance")
    return ConfidenceWeights(**dict(zip(names, weights, strict=False)))


def _duration(value: float | timedelta) -> Duration:
    duration = Duration()
    if isinstance(value, timedelta):
        duration.FromTimedelta(value)
    else:
        duration.FromNanoseconds(round(value * 1e9))
    return duration


def _pins(pins: Pins) -> list[match_service_pb2.Pin]:
    given = [Pin(*each) for each in pins.items()] if isinstance(pins, Mapping) else pins
    return [
        match_service_pb2.Pin(
            sketch_object=_reference(pin.sketch),
            map_object=None if pin.map is None else _reference(pin.map),
            excluded=pin.excluded,
        )
        for pin in map(_checked_pin, given)
    ]


def _checked_pin(given: Any) -> Pin:
    if not isinstance(given, Pin):
        raise TypeError
    return given


def _reference(given: Any) -> ObjectReference:
    if isinstance(given, str):
        return ObjectReference(label=given)
    if isinstance(given, bool):
        raise TypeError
    return ObjectReference(index=given)


def _synonyms(groups: Iterable[Iterable[str]]) -> list[Synonyms]:
    if isinstance(groups, str):
        raise TypeError
    return [Synonyms(labels=_labels(group)) for group in groups]


def _labels(group: Iterable[str]) -> list[str]:
    if isinstance(group, str):
        raise TypeError
    return list(group)


def _priority(name: str) -> match_service_pb2.Priority.ValueType:
    if not isinstance(name, str):
        raise TypeError
    return match_service_pb2.Priority.Value(f"PRIORITY_{name.upper()}")


def _same(value: Any) -> Any:
    return value


_FIELDS: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "seed": ("give an integer 0 … 2**64 − 1", _same),
    "time_budget": ("give a positive time in seconds, or none at all", _duration),
    "weights": (
        "give three numbers, similarity, rotation, dilation, or five, with shape and size, "
        "or six, with distance",
        _weights,
    ),
    "allow_unmatched": ("give True or False", _same),
    "unmatched_price": ("give a number", _same),
    "alternatives": ("give a whole number from 0 to 100", _same),
    "pins": (
        "give a dict from sketched to mapped objects, or Pin values; objects by index, from 0, or "
        "by label",
        _pins,
    ),
    "synonyms": ("give groups of labels, as in [('couch', 'sofa')]", _synonyms),
    "request_id": ("give a text of at most 128 bytes", _same),
    "keep_running": ("give True or False", _same),
    "priority": ("give 'low', 'normal' or 'high'", _priority),
}
"""Options that are fields of the request: what to give instead of a wrong value, and how to write
one."""
