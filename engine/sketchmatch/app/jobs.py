"""What requests ask for, done in whichever process they are answered in."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from typing import cast

from google.protobuf.message import Message
from google.protobuf.wrappers_pb2 import BytesValue

from sketchmatch.api import Segmentation, Segmenter
from sketchmatch.app import requests, responses
from sketchmatch.app.costs import Costs
from sketchmatch.app.setup import Setup
from sketchmatch.app.shelf import (
    LARGEST_KEPT,
    Described,
    cleaned_title,
    described_by,
    name_of,
    segmentation,
    without_store,
)
from sketchmatch.errors import (
    AnswerUnavailableError,
    InvalidInputError,
    PluginError,
    Reason,
    ServerStoppingError,
    StoreError,
)
from sketchmatch.io.ros_map import encode_map_server
from sketchmatch.model import OccupancyGrid, Scene, SceneDescriptor
from sketchmatch.model import Source as AnySource
from sketchmatch.pipeline.clock import Clock
from sketchmatch.pipeline.describe import in_directions
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.events import Accepted, MatchEvent, Progress
from sketchmatch.pipeline.former import Former
from sketchmatch.pipeline.selection import Choice, chosen_algorithms, stage_of
from sketchmatch.pipeline.slices import finish, retold
from sketchmatch.registry import Registered, RegisteredReader
from sketchmatch.transfers.transfer import run_transfer
from sketchmatch_proto.v1.match_pb2 import AlternativeMap, MatchResult
from sketchmatch_proto.v1.match_service_pb2 import MatchRequest
from sketchmatch_proto.v1.scene_service_pb2 import (
    GetSceneResponse,
    PutSceneRequest,
    SegmentRequest,
    StoredScene,
)
from sketchmatch_proto.v1.sketch_service_pb2 import CreateSketchRequest, SketchObjects
from sketchmatch_proto.v1.source_pb2 import MapServerMap, Source
from sketchmatch_proto.v1.transfer_service_pb2 import TransferRequest

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
    caller, brought, former
        As of an :class:`~sketchmatch.app.orders.Order`.
    """

    id: str
    request: Message
    caller: str = ""
    brought: tuple[bytes, ...] = ()
    former: tuple[bytes, bytes] | None = None


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
    try:
        yield from _answers(job, setup, begun)
    except PluginError:
        # Who broke its contract may have written into what others would be given next.
        if setup.engine.memory is not None:
            setup.engine.memory.forget()
        if setup.shelf is not None:
            setup.shelf.forget()
        raise


def _answers(
    job: Job, setup: Setup, begun: Callable[[Clock], None]
) -> Generator[Message, None, None]:
    match job.request:
        case MatchRequest():
            return _match(job, job.request, setup, begun)
        case SegmentRequest():
            return _segment(job.request, setup)
        case PutSceneRequest():
            return _put_scene(job.request, setup)
        case CreateSketchRequest():
            return _map_of_sketch(job, job.request, setup)
        case TransferRequest():
            return _transfer(job, job.request, setup, begun)
    raise TypeError(f"a {type(job.request).__name__} is no request for work")


def algorithms(job: Job, setup: Setup) -> tuple[Registered | RegisteredReader, ...]:
    """Return what a request asks of plugins, as far as it can be told without decoding it.

    These are the algorithms that it names and the readers of its files.

    Raises
    ------
    InvalidInputError
        If an algorithm, the profile or the kind of a file is unknown, with its path in the request.
    """
    request, profile, place = job.request, "", "pipeline"
    if isinstance(request, CreateSketchRequest):
        try:
            return algorithms(replace(job, request=request.match), setup)
        except InvalidInputError as error:
            raise error.within("match") from None
    readers = setup.engine.registry.readers
    match request:
        case MatchRequest() | TransferRequest():
            selection, profile = requests.selection(request), request.pipeline.profile
            types = {
                "sketch_segmenter": requests.source_type(request.sketch, readers),
                "map_segmenter": requests.source_type(request.map, readers),
            }
            files = {"sketch": request.sketch, "map": request.map}
        case SegmentRequest(profile=profile) | PutSceneRequest(profile=profile):
            found, files = requests.source_type(request.source, readers), {"source": request.source}
            stage, place = "sketch_segmenter" if found is None else stage_of(found), ""
            selection, types = {stage: requests.choice(request.segmenter)}, {stage: found}
        case _:
            return ()
    sources = {stage: kind for stage, kind in types.items() if kind is not None}
    known: dict[str, Choice] = {
        stage: choice
        for stage, choice in selection.items()
        if stage in sources or not stage.endswith("segmenter")
    }
    kinds = (requests.file_kind(file, field, readers) for field, file in files.items())
    reading = tuple(kind.reader for kind in kinds if kind is not None and kind.reader is not None)
    try:
        chosen = chosen_algorithms(
            setup.engine.registry, known, sources, setup.engine.defaults, profile
        )
    except InvalidInputError as error:
        field = error.field if place else error.field.replace(stage, "segmenter")
        raise InvalidInputError(error.reason, field, error.problem).within(place) from None
    return (*reading, *chosen)


def time_budget(job: Job, setup: Setup) -> float | None:
    """Return the seconds that a job may take, or None for no limit."""
    if isinstance(job.request, MatchRequest | TransferRequest):
        return requests.time_budget(job.request, setup.limits)
    return None


def _match(
    job: Job, request: MatchRequest, setup: Setup, begun: Callable[[Clock], None]
) -> Generator[Message, None, None]:
    engine = _within_costs(setup)
    with engine.limited():
        value = requests.match_request(
            request, setup.limits, engine.registry.readers, _stored(job, setup)
        )
    if job.former is not None:
        value = replace(value, former=_former(*job.former))
    writer, clock = responses.ResponseWriter(value), Clock(value.time_budget)
    begun(clock)
    with (
        requests.paths_of(request),
        _stopping(clock),
        closing(engine.match(value, job.id, clock)) as events,
    ):
        for event in events:
            yield writer.response(event)


def _within_costs(setup: Setup) -> Engine:
    """Return the engine, for matches that may cost so much."""
    check = Costs(setup.limits, setup.engine.registry).check
    return replace(setup.engine, check=check)


def _transfer(
    job: Job, request: TransferRequest, setup: Setup, begun: Callable[[Clock], None]
) -> Generator[Message, None, None]:
    """Carry features; before the response there is the progress of the match, a sign of life."""
    engine = _within_costs(setup)
    with engine.limited():
        value = requests.transfer_request(
            request, setup.limits, engine.registry.readers, _stored(job, setup)
        )
        value = replace(value, sources=_sources_of_stored(request, setup))
    writer, clock = responses.ResponseWriter(value.match), Clock(value.match.time_budget)
    begun(clock)
    with (
        requests.paths_of(request),
        _stopping(clock),
        closing(run_transfer(value, engine, job.id, clock)) as work,
    ):
        found = yield from retold(work, lambda event: _progress(event, writer))
    yield responses.transferred(found)


def _sources_of_stored(
    request: TransferRequest, setup: Setup
) -> tuple[AnySource | None, AnySource | None]:
    """Return what the stored scenes that a request names were found in: walls are no objects."""

    def source(side: Source, name: str) -> AnySource | None:
        if setup.shelf is None or side.WhichOneof("kind") != "stored_scene":
            return None
        kept = setup.shelf.source(side.stored_scene)
        if kept is None:
            raise StoreError(
                f"the stored source of {name}.stored_scene cannot be read; store the scene again"
            )
        return requests.source(kept, name, True, setup.engine.registry.readers)

    return source(request.sketch, "sketch"), source(request.map, "map")


def _progress(event: MatchEvent, writer: responses.ResponseWriter) -> Iterator[Message]:
    told = writer.response(event)  # of each event: progress names what earlier ones found
    if isinstance(event, Progress):
        yield told


@contextmanager
def _stopping(clock: Clock) -> Iterator[None]:
    """Say that the server stopped, where that ended the time."""
    try:
        yield
    except AnswerUnavailableError:
        if clock.curtailed:
            raise ServerStoppingError("the server stopped before there was an answer") from None
        raise


def _stored(job: Job, setup: Setup) -> requests.Stored:
    """Return what finds the stored scenes that a job may name."""
    brought = {StoredScene.FromString(record).name: record for record in job.brought}

    def stored(name: str, field: str) -> Segmentation:
        if name in brought:
            record = brought[name]
            if setup.shelf is not None:
                return setup.shelf.decoded(name, record)
            return segmentation(StoredScene.FromString(record))
        if setup.shelf is None:
            raise without_store(field)
        return setup.shelf.segmentation(name, job.caller, field)

    return stored


def _former(objects: bytes, result: bytes) -> Former:
    """Read what was found in a sketch before it was changed."""
    found, told = SketchObjects.FromString(objects), MatchResult.FromString(result)
    sketch = segmentation(StoredScene(scene=found.scene)).scene
    maps: tuple[MatchResult | AlternativeMap, ...] = (told, *told.alternatives)
    return Former(
        sketch,
        tuple(
            {line.sketch_object: line.map_object for line in each.object_matches} for each in maps
        ),
        1.0 - told.place_probability if told.HasField("place_probability") else None,
    )


def _put_scene(request: PutSceneRequest, setup: Setup) -> Generator[Message, None, None]:
    """Find the objects of a source to be kept; one that is kept already is told by its name.

    Either has the title of the request, which only the caller's own list of scenes keeps.
    """
    engine, given, title = setup.engine, request.source, cleaned_title(request.title)
    source, segmenter = _source_and_segmenter(request, setup)
    name, data = name_of(given, segmenter, engine.registry)
    if setup.shelf is not None and (known := setup.shelf.record(name)) is not None:
        record = StoredScene.FromString(known)
        record.title = title
        yield GetSceneResponse(stored_scene=record)
        return
    with requests.paths_of(request):
        found = engine.segment(source, segmenter, f"source.{source.field}")
    record = responses.stored_scene(name, found, segmenter)
    response = GetSceneResponse(stored_scene=record, source=Source.FromString(data))
    response.stored_scene.title = title
    yield response
    if setup.shelf is not None:
        found = setup.shelf.decoded(name, record.SerializeToString())
    yield BytesValue(value=Described.within(found.scene).packed())
    for each in _describe(found.scene, request.profile, setup):
        if each.histograms.nbytes <= LARGEST_KEPT:
            described = Described(each.scene, described_by(each.described_by), each.histograms)
            yield BytesValue(value=described.packed())


def _map_of_sketch(
    job: Job, request: CreateSketchRequest, setup: Setup
) -> Generator[Message, None, None]:
    """Find the objects of the map of a sketch, once it is known that the match can be had."""
    engine, match = _within_costs(setup), MatchRequest()
    requests.upward_of(request.y_axis)
    match.CopyFrom(request.match)
    try:
        if match.HasField("sketch"):
            problem = "is set, but a sketch begins empty; add its strokes by UpdateSketch"
            raise InvalidInputError(Reason.INVALID_FIELD, "sketch", problem)
        stroke = match.sketch.stroke_set.strokes.add()
        for x in (0.0, 1.0, 2.0):
            stroke.points.add(x=x, y=x * x)
        with engine.limited():
            value = requests.match_request(
                match, setup.limits, engine.registry.readers, _stored(job, setup)
            )
        with requests.paths_of(match), closing(engine.match(value)) as events:
            pipeline = cast(Accepted, next(events)).pipeline
            found = engine.segment_side("map", value.map, pipeline)
    except InvalidInputError as error:
        raise error.within("match") from None
    if pipeline.map_segmenter is None:
        record = responses.stored_scene(match.map.stored_scene, found)
    else:
        name, _ = name_of(match.map, pipeline.map_segmenter, engine.registry)
        record = responses.stored_scene(name, found, pipeline.map_segmenter)
    yield GetSceneResponse(stored_scene=record)
    if setup.shelf is not None:
        found = setup.shelf.decoded(record.name, record.SerializeToString())
    _describe(found.scene, match.pipeline.profile, setup)


def _describe(scene: Scene, profile: str, setup: Setup) -> list[SceneDescriptor]:
    """Describe a scene as most matches will need it, which is remembered."""
    engine = setup.engine
    histogram = engine.resolve({}, profile=profile).histogram
    ways = (histogram, in_directions(histogram, histogram.directions))
    try:
        found = [finish(engine.describe(scene, each)) for each in ways]
    except InvalidInputError:
        return []  # a match will be told
    return [*{each.described_by: each for each in found}.values()]


def _source_and_segmenter(
    request: SegmentRequest | PutSceneRequest, setup: Setup
) -> tuple[AnySource, Segmenter]:
    engine = setup.engine
    with engine.limited():
        source = requests.source(
            request.source, "source", request.HasField("source"), engine.registry.readers
        )
    choice = requests.checked_choice(request.segmenter, "segmenter")
    return source, engine.resolve_segmenter(choice, source, request.profile)


def _segment(request: SegmentRequest, setup: Setup) -> Generator[Message, None, None]:
    source, segmenter = _source_and_segmenter(request, setup)
    with requests.paths_of(request):
        found = setup.engine.segment(source, segmenter, f"source.{source.field}")
    yield responses.segmented(found, segmenter, _map_of(request, source))


def _map_of(request: SegmentRequest, source: AnySource) -> MapServerMap | None:
    """Return the map that is in a source, where it is wanted."""
    if not (request.include_map and isinstance(source, OccupancyGrid)):
        return None
    if request.source.HasField("map_server_map"):
        return request.source.map_server_map
    yaml, picture = encode_map_server(source)
    return MapServerMap(yaml=yaml, image=picture)
