"""What requests ask for, done in whichever process they are answered in."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import dataclass

from google.protobuf.message import Message

from sketchmatch.app import requests, responses
from sketchmatch.app.costs import Costs
from sketchmatch.app.setup import Setup
from sketchmatch.errors import AnswerUnavailableError, InvalidInputError, ServerStoppingError
from sketchmatch.pipeline.clock import Clock
from sketchmatch.pipeline.selection import Choice, chosen_algorithms, stage_of
from sketchmatch.registry import Registered, RegisteredReader
from sketchmatch_proto.v1.match_service_pb2 import MatchRequest
from sketchmatch_proto.v1.scene_service_pb2 import SegmentRequest

__all__ = ["Job", "algorithms", "answers", "time_budget"]


@dataclass(frozen=True)
class Job:
    """A request to be answered.

    Attributes
    ----------
    id
        A name that no other job of the application has.
    request
        A message of the contract that wants work; which one says what is to be done.
    """

    id: str
    request: Message


def answers(
    job: Job, setup: Setup, begun: Callable[[Clock], None] = lambda _: None
) -> Generator[Message, None, None]:
    """Do a job, yielding its responses; a request is decoded and resolved here alone.

    Parameters
    ----------
    job, setup
        What is to be done, and with what.
    begun
        Called with the clock of a match, for whoever may have to curtail it.

    Raises
    ------
    SketchmatchError
        As the engine does, with paths of the request.
    """
    match job.request:
        case MatchRequest():
            return _match(job.id, job.request, setup, begun)
        case SegmentRequest():
            return _segment(job.request, setup)
    raise TypeError(f"a {type(job.request).__name__} is no request for work")


def algorithms(job: Job, setup: Setup) -> tuple[Registered | RegisteredReader, ...]:
    """Return what a request asks of plugins, as far as it can be told without decoding it.

    These are the algorithms that it names and the readers of its files. A name that is not known is
    refused where the job is done.
    """
    request, profile = job.request, ""
    readers = setup.engine.registry.readers
    match request:
        case MatchRequest():
            selection, profile = requests.selection(request), request.pipeline.profile
            types = {
                "sketch_segmenter": requests.source_type(request.sketch, readers),
                "map_segmenter": requests.source_type(request.map, readers),
            }
            files = [request.sketch, request.map]
        case SegmentRequest(profile=profile):
            found, files = requests.source_type(request.source, readers), [request.source]
            stage = "sketch_segmenter" if found is None else stage_of(found)
            selection, types = {stage: requests.choice(request.segmenter)}, {stage: found}
        case _:
            return ()
    sources = {stage: kind for stage, kind in types.items() if kind is not None}
    known: dict[str, Choice] = {
        stage: choice
        for stage, choice in selection.items()
        if stage in sources or not stage.endswith("segmenter")
    }
    kinds = (requests.file_kind(file, readers) for file in files)
    reading = tuple(kind.reader for kind in kinds if kind is not None and kind.reader is not None)
    try:
        chosen = chosen_algorithms(
            setup.engine.registry, known, sources, setup.engine.defaults, profile
        )
    except InvalidInputError:
        return reading
    return (*reading, *chosen)


def time_budget(job: Job, setup: Setup) -> float | None:
    """Return the seconds that a job may take, or None for no limit."""
    if isinstance(job.request, MatchRequest):
        return requests.time_budget(job.request, setup.limits)
    return None


def _match(
    name: str, request: MatchRequest, setup: Setup, begun: Callable[[Clock], None]
) -> Generator[Message, None, None]:
    engine = setup.engine
    with engine.limited():
        value = requests.match_request(request, setup.limits, engine.registry.readers)
    writer, clock = responses.ResponseWriter(value), Clock(value.time_budget)
    begun(clock)
    with requests.paths_of(request), closing(engine.match(value, name, clock)) as events:
        try:
            costs = Costs(setup.limits, engine.registry)
            for event in events:
                costs.check(event)
                yield writer.response(event)
        except AnswerUnavailableError:
            if clock.curtailed:
                raise ServerStoppingError("the server stopped before any answer") from None
            raise


def _segment(request: SegmentRequest, setup: Setup) -> Generator[Message, None, None]:
    engine = setup.engine
    with engine.limited():
        source = requests.source(
            request.source, "source", request.HasField("source"), engine.registry.readers
        )
    segmenter = engine.resolve_segmenter(
        requests.choice(request.segmenter), source, request.profile
    )
    with requests.paths_of(request):
        found = engine.segment(source, segmenter, f"source.{source.field}")
    yield responses.segmented(found, segmenter)
