"""What requests ask for, done in whichever process they are answered in."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import closing

from sketchmatch.errors import InvalidInputError
from sketchmatch.model import Scene, Source
from sketchmatch.pipeline.match import run_match
from sketchmatch.pipeline.plugins import segmented
from sketchmatch.pipeline.request import MatchRequest
from sketchmatch.pipeline.selection import chosen_algorithms, resolve_segmenter, stage_of
from sketchmatch.registry import Registered
from sketchmatch.server import requests, responses
from sketchmatch.server.setup import Setup
from sketchmatch_proto.v1 import match_service_pb2, scene_service_pb2

__all__ = [
    "match_algorithms",
    "match_responses",
    "read_match",
    "read_source",
    "segment_algorithms",
    "segment_response",
]

_Algorithms = tuple[Registered, ...]


def read_match(request: match_service_pb2.MatchRequest, setup: Setup) -> MatchRequest:
    """Read a request to match.

    Raises
    ------
    InvalidInputError
        If it cannot be used, with the path of the field.
    """
    return requests.match_request(request, setup.limits.max_time_budget)


def match_algorithms(value: MatchRequest, setup: Setup) -> _Algorithms:
    """Return the algorithms that a match uses.

    Raises
    ------
    InvalidInputError
        If one is unknown, or the profile is.
    """
    sides = {"sketch_segmenter": value.sketch, "map_segmenter": value.map}
    sources = {stage: side for stage, side in sides.items() if not isinstance(side, Scene)}
    try:
        return chosen_algorithms(
            setup.registry, value.selection, sources, setup.defaults, value.profile
        )
    except InvalidInputError as error:
        raise error.within("pipeline") from None


def match_responses(
    request: match_service_pb2.MatchRequest, value: MatchRequest, setup: Setup
) -> Generator[match_service_pb2.MatchResponse, None, None]:
    """Match, yielding the responses to ``request``, which says ``value``.

    Raises
    ------
    SketchmatchError
        As :func:`sketchmatch.pipeline.match.run_match` does, with paths of the request.
    """
    writer = responses.ResponseWriter(value)
    running = run_match(value, setup.registry, setup.defaults)
    with requests.paths_of(request), closing(running) as events:
        for event in events:
            yield writer.response(event)


def read_source(request: scene_service_pb2.SegmentRequest) -> Source:
    """Read what is to be segmented.

    Raises
    ------
    InvalidInputError
        If it cannot be used, with the path of the field.
    """
    return requests.source(request.source, "source", request.HasField("source"))


def segment_algorithms(
    request: scene_service_pb2.SegmentRequest, source: Source, setup: Setup
) -> _Algorithms:
    """Return the segmenter that a request asks for.

    Raises
    ------
    InvalidInputError
        If it is unknown.
    """
    stage = stage_of(source)
    try:
        return chosen_algorithms(
            setup.registry,
            {stage: requests.choice(request.segmenter)},
            {stage: source},
            setup.defaults,
            request.profile,
        )
    except InvalidInputError as error:
        field = error.field.replace(stage, "segmenter", 1)
        raise InvalidInputError(error.reason, field, error.problem) from None


def segment_response(
    request: scene_service_pb2.SegmentRequest, source: Source, setup: Setup
) -> scene_service_pb2.SegmentResponse:
    """Segment, and return the response to ``request``, whose source is ``source``.

    Raises
    ------
    SketchmatchError
        As :func:`sketchmatch.pipeline.plugins.segmented` does, with paths of the request.
    """
    chosen = requests.choice(request.segmenter)
    segmenter = resolve_segmenter(setup.registry, chosen, source, setup.defaults, request.profile)
    with requests.paths_of(request):
        found = segmented(source, segmenter, setup.registry, f"source.{source.field}")
    return responses.segmented(found, segmenter)
