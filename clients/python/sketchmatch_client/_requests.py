"""From plain Python values to requests."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import timedelta
from typing import Any, TypedDict

from google.protobuf.duration_pb2 import Duration
from google.protobuf.struct_pb2 import Struct

from sketchmatch_client.errors import InvalidRequestError, refused_as
from sketchmatch_proto.v1.match_pb2 import ConfidenceWeights
from sketchmatch_proto.v1.match_service_pb2 import MatchRequest
from sketchmatch_proto.v1.pipeline_pb2 import AlgorithmSelection, Pipeline
from sketchmatch_proto.v1.scene_service_pb2 import SegmentRequest
from sketchmatch_proto.v1.source_pb2 import Source

__all__ = ["MatchOptions", "match_request", "segment_request"]

Weights = (
    tuple[float, float, float]
    | tuple[float, float, float, float, float]
    | tuple[float, float, float, float, float, float]
)
"""Of similarity, rotation and dilation in ζ, perhaps of shape and size, and of distance in ζR."""

_STAGES = ("sketch_segmenter", "map_segmenter", "histogram", "similarity", "searcher")


class MatchOptions(TypedDict, total=False):
    """How to match; whatever is left out is the server's to decide.

    Attributes
    ----------
    sketch_segmenter, map_segmenter, histogram, similarity, searcher
        Names of algorithms; :meth:`Client.algorithms` lists them.
    params
        Parameters by stage, e.g. ``{"searcher": {"population": 200}}``. The stages are the
        names of the five options above.
    seed
        Seed of everything random, from 0 to 2**64 − 1. Left out: 0.
    time_budget
        Seconds, or a timedelta, after which the best match so far is the result.
    weights
        Weights of similarity, rotation and dilation in ζ, with two numbers more of the objects'
        own shape and size, and with a sixth the exponent β by which the rotation of two objects
        that are d apart counts for d^β. Left out: as the profile says, or else 1, 1, 1, 0, 0, 0.
    allow_unmatched
        Whether an object may stay without partner on both sides where that is likelier. Left out:
        as the profile says, or else not.
    unmatched_price
        What a match loses that leaves all objects of the smaller scene out, in units of ζ, and in
        proportion where it leaves out some. Left out: one that fits the weights.
    alternatives
        How many of the next best object maps the result shall hold. Left out: 3, or as many as
        there are.
    profile
        Name of one of the server's pipelines, e.g. ``"fast"`` or ``"proof"``, to start from; what
        the options above say wins. Left out: the server's default one.
    """

    sketch_segmenter: str | None
    map_segmenter: str | None
    histogram: str | None
    similarity: str | None
    searcher: str | None
    params: Mapping[str, Mapping[str, Any]] | None
    seed: int | None
    time_budget: float | timedelta | None
    weights: Weights | None
    allow_unmatched: bool | None
    unmatched_price: float | None
    alternatives: int | None
    profile: str | None


def match_request(
    sketch: Source,
    map: Source,  # noqa: A002
    *,
    params: Mapping[str, Mapping[str, Any]] | None = None,
    seed: int | None = None,
    time_budget: float | timedelta | None = None,
    weights: Weights | None = None,
    allow_unmatched: bool | None = None,
    unmatched_price: float | None = None,
    alternatives: int | None = None,
    profile: str | None = None,
    **names: str | None,
) -> MatchRequest:
    """Return the request for a match; see :class:`MatchOptions`.

    Examples
    --------
    >>> match_request(Source(), Source(), searcher="easm", seed=7).pipeline.searcher.name
    'easm'
    """
    request = MatchRequest(sketch=sketch, map=map, pipeline=_pipeline(names, params or {}))
    if profile:
        request.pipeline.profile = profile
    if seed is not None:
        with refused_as("INVALID_FIELD", "seed", "is not a whole number from 0 to 2**64 − 1"):
            request.seed = seed
    if time_budget is not None:
        with refused_as("INVALID_FIELD", "time_budget", "is not a number of seconds"):
            request.time_budget.CopyFrom(_duration(time_budget))
    if weights is not None:
        with refused_as(
            "INVALID_FIELD",
            "weights",
            "is not three numbers, similarity, rotation, dilation, or five, with shape and size, "
            "or six, with distance",
        ):
            request.weights.CopyFrom(_weights(*weights))
    if allow_unmatched is not None:
        with refused_as("INVALID_FIELD", "allow_unmatched", "is neither True nor False"):
            request.allow_unmatched = allow_unmatched
    if unmatched_price is not None:
        with refused_as("INVALID_FIELD", "unmatched_price", "is not a number"):
            request.unmatched_price = unmatched_price
    if alternatives is not None:
        with refused_as("INVALID_FIELD", "alternatives", "is not a whole number from 0 to 100"):
            request.alternatives = alternatives
    return request


def segment_request(
    source: Source,
    segmenter: str | None,
    params: Mapping[str, Any] | None,
    profile: str | None = None,
) -> SegmentRequest:
    """Return the request for the objects of one source."""
    request = SegmentRequest(source=source, profile=profile or "")
    if segmenter or params:
        request.segmenter.CopyFrom(_selection("segmenter", segmenter or "", params or {}))
    return request


def _pipeline(names: Mapping[str, str | None], params: Mapping[str, Mapping[str, Any]]) -> Pipeline:
    if unknown := sorted(names.keys() - set(_STAGES)):
        raise TypeError(f"unknown option {unknown[0]!r}; MatchOptions lists those there are")
    if unknown := sorted(params.keys() - set(_STAGES)):
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
    selection = AlgorithmSelection(name=name)
    if params:
        struct = Struct()
        with refused_as("INVALID_FIELD", f"{field}.parameters", "holds a value that is not JSON"):
            struct.update(params)
        selection.parameters.CopyFrom(struct)
    return selection


def _weights(similarity: float, rotation: float, dilation: float, *own: float) -> ConfidenceWeights:
    names = ("shape", "size", "distance")
    if len(own) not in (0, 2, 3):
        raise ValueError
    return ConfidenceWeights(
        similarity=similarity,
        rotation=rotation,
        dilation=dilation,
        **dict(zip(names, own, strict=False)),
    )


def _duration(value: float | timedelta) -> Duration:
    duration = Duration()
    if not isinstance(value, timedelta):
        value = timedelta(seconds=value)
    duration.FromTimedelta(value)
    return duration
