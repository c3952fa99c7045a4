"""Sketches in progress: what is drawn so far, and what comes of the latest revision of it.

Each sketch has one runner, which matches the latest revision there is as soon as the one before is
done, by the same requests as ``MatchService.Match``; revisions that came in between are skipped.
So an answer is that of a match of the same strokes, whatever was drawn and erased before. What
workers remember of scenes makes it soon: the map is decoded and described once, and of the sketch
only the relations of objects that changed are described and compared with the map anew.
"""

from __future__ import annotations

import asyncio
import itertools
import logging
import math
import secrets
import time
from collections import Counter
from collections.abc import AsyncGenerator, Coroutine, Iterator, Mapping, Sized
from contextlib import aclosing, suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

from sketchmatch.app import requests
from sketchmatch.app.following import followed
from sketchmatch.app.packed import Packed
from sketchmatch.app.setup import SketchLimits
from sketchmatch.app.tasks import Log
from sketchmatch.app.waiting import Caller
from sketchmatch.errors import (
    InvalidInputError,
    NotFoundError,
    Reason,
    ServerStoppingError,
    SketchmatchError,
    TooBusyError,
    counted,
    quoted,
)
from sketchmatch_proto.v1 import match_pb2
from sketchmatch_proto.v1.match_service_pb2 import MatchRequest, MatchResponse, Pin
from sketchmatch_proto.v1.scene_service_pb2 import GetSceneResponse, StoredScene
from sketchmatch_proto.v1.sketch_service_pb2 import (
    CreateSketchRequest,
    CreateSketchResponse,
    DeleteSketchRequest,
    DeleteSketchResponse,
    QuestionOption,
    SketchMap,
    SketchObjects,
    SketchProblem,
    SketchQuestion,
    SketchResult,
    UpdateSketchRequest,
    UpdateSketchResponse,
    WatchSketchRequest,
    WatchSketchResponse,
)
from sketchmatch_proto.v1.source_pb2 import Stroke

if TYPE_CHECKING:
    from sketchmatch.app.application import Application

__all__ = ["Sketches", "question"]

_log = logging.getLogger(__name__)

_REVISIONS = 256
_BYTES = 8 * 1024 * 1024
"""Memory for the revisions of a sketch; beyond it the oldest are forgotten, never the latest."""

_OF_MESSAGE, _OF_POINT = 1024, 48
"""Bytes of memory that a message takes, and a point in it, beside those it is sent as."""

_LONGEST_NAME = 64
# Seconds for which a sketch that nobody draws or watches is kept, although its creator begins more.
_SPARED = 60.0
_SLOW = 0.1
"""Seconds after which the progress of a search is worth telling."""

_PEN_RESTS = 0.15
"""Seconds without a change after which a quick answer is followed by the whole one."""

_OVERTAKEN = 0.5
"""Seconds after which a match of a revision that is not the latest is given up."""

_Part = TypeVar("_Part", Stroke, Pin)


@dataclass(frozen=True)
class _State:
    """What is drawn in one revision, in the order in which it was first set."""

    strokes: Mapping[str, Stroke] = field(default_factory=dict)
    pins: tuple[Pin, ...] = ()

    @property
    def parts(self) -> Iterator[Stroke | Pin]:
        """All that it consists of."""
        return itertools.chain(self.strokes.values(), self.pins)


class _Board(Log[bytes]):
    """The latest event of each kind, so that who comes late or reads slowly misses old ones."""

    def __init__(self) -> None:
        super().__init__()
        self._latest: dict[str, tuple[int, bytes]] = {}

    def put(self, place: str, event: WatchSketchResponse) -> None:
        """Put an event in the place of the one that was there."""
        with self._lock:
            self._count += 1
            self._latest[place] = (self._count, event.SerializeToString())
        self._wake()

    def next(self, seen: int) -> tuple[int, bytes] | None:
        """Return the first event that is left of those after number ``seen``."""
        with self._lock:
            waiting = [each for each in self._latest.values() if each[0] > seen]
        return min(waiting, key=lambda each: each[0], default=None)


class _Sketch:
    """One sketch in progress.

    Parameters
    ----------
    caller
        Whose it is.
    request
        The match of each revision, but for the sketch and its pins.
    y_axis
        Of the strokes.
    record
        The map, as a message ``StoredScene``.
    """

    def __init__(self, caller: Caller, request: MatchRequest, y_axis: int, record: bytes) -> None:
        self.caller = caller
        self.record = record
        self.board = _Board()
        self.revision = 0
        self.done = -1
        self.former: tuple[bytes, bytes] | None = None
        """Objects and result of the last revision that has any."""
        self.touched = time.monotonic()
        self.watchers = 0
        self.changed = asyncio.Event()
        self.runner: asyncio.Task[None] | None = None
        self._request = request
        self._y_axis = y_axis
        self._states: dict[int, _State] = {}
        self._uses: Counter[int] = Counter()
        self._bytes = 0
        self._keep(_State(pins=tuple(request.pins)))
        self.board.put("map", _map_event(StoredScene.FromString(record)))

    @property
    def state(self) -> _State:
        """What is drawn."""
        return self._states[self.revision]

    def at(self, revision: int) -> _State:
        """Return what was drawn in a revision that is still known."""
        if revision not in self._states:
            forgotten = revision < (oldest := min(self._states))
            raise InvalidInputError(
                Reason.INVALID_FIELD,
                "restore_revision",
                f"is {revision}, which {'is no longer kept' if forgotten else 'does not exist yet'}"
                f"; give a revision from {oldest} to {self.revision}",
            )
        return self._states[revision]

    def change(self, state: _State) -> None:
        """Make the next revision, and forget the oldest that are too many or take too much."""
        self.revision += 1
        self._keep(state)
        while len(self._states) > 1 and (len(self._states) > _REVISIONS or self._bytes > _BYTES):
            self._forget(min(self._states))
        self.changed.set()

    def _keep(self, state: _State) -> None:
        self._states[self.revision] = state
        for part in state.parts:  # which revisions share
            if not self._uses[id(part)]:
                self._bytes += _size(part)
            self._uses[id(part)] += 1

    def _forget(self, revision: int) -> None:
        for part in self._states.pop(revision).parts:
            self._uses[id(part)] -= 1
            if not self._uses[id(part)]:
                del self._uses[id(part)]
                self._bytes -= _size(part)

    def request(self) -> bytes:
        """Return the request for a match of the latest revision."""
        request, state = MatchRequest(), self.state
        request.CopyFrom(self._request)
        del request.pins[:]
        request.pins.extend(state.pins)
        request.sketch.stroke_set.y_axis = self._y_axis  # type: ignore[assignment]
        request.sketch.stroke_set.strokes.extend(state.strokes.values())
        return request.SerializeToString()


class Sketches:
    """All sketches in progress of a server, in its event loop.

    Parameters
    ----------
    app
        Matches them, and says how many are kept, and for how long.
    """

    def __init__(self, app: Application) -> None:
        self._app = app
        self._all: dict[str, _Sketch] = {}
        self._closed = False

    async def create(self, data: bytes, caller: Caller) -> CreateSketchResponse:
        """Begin a sketch; ``data`` is a ``CreateSketchRequest``."""
        self._check_room(caller)
        opened = Packed(data, CreateSketchRequest.FromString).opened(
            self._app.setup.limits.max_request_bytes
        )
        assert isinstance(opened, CreateSketchRequest)
        with self._app.running("CreateSketchRequest", data, caller) as task:
            answers = [response async for _, response in followed(task.log)]
        if not answers:
            raise ServerStoppingError("the server is about to stop")
        found = GetSceneResponse.FromString(answers[0]).stored_scene
        self._check_room(caller)
        request = opened.match
        request.map.Clear()
        request.map.stored_scene = found.name
        request.pipeline.ClearField("map_segmenter")
        sketch = _Sketch(caller, request, opened.y_axis, found.SerializeToString())
        name = secrets.token_urlsafe(18)
        self._all[name] = sketch
        sketch.runner = asyncio.create_task(self._run(sketch))
        response = CreateSketchResponse(sketch_id=name)
        response.idle_timeout.FromMilliseconds(round(1e3 * self._limits.idle_seconds))
        return response

    async def update(self, request: UpdateSketchRequest, caller: Caller) -> UpdateSketchResponse:
        """Change a sketch."""
        sketch = self._sketch(request.sketch_id, caller)
        state = sketch.state
        if request.HasField("restore_revision"):
            state = sketch.at(request.restore_revision)
        state = replace(state, strokes=self._drawn(dict(state.strokes), request))
        if request.HasField("pins"):
            for k, each in enumerate(request.pins.pins):
                requests.pin(each, f"pins.pins[{k}]")
            state = replace(state, pins=tuple(map(_apart, request.pins.pins)))
        sketch.change(state)
        return UpdateSketchResponse(revision=sketch.revision, stroke_count=len(state.strokes))

    async def watch(
        self, request: WatchSketchRequest, caller: Caller
    ) -> AsyncGenerator[bytes, None]:
        """Yield what comes of a sketch, until it ends."""
        sketch = self._sketch(request.sketch_id, caller)
        sketch.watchers += 1
        try:
            async with aclosing(followed(sketch.board)) as events:
                async for _, event in events:
                    yield event
        finally:
            sketch.watchers -= 1
            sketch.touched = time.monotonic()

    async def delete(self, request: DeleteSketchRequest, caller: Caller) -> DeleteSketchResponse:
        """End a sketch."""
        self._sketch(request.sketch_id, caller)
        self._end(request.sketch_id, NotFoundError("the sketch was deleted; create another"))
        return DeleteSketchResponse()

    def stop(self) -> None:
        """End all sketches, and begin none."""
        self._closed = True
        for name in tuple(self._all):
            self._end(name, ServerStoppingError("the server is about to stop"))

    def look(self) -> None:
        """End the sketches that nobody draws or watches; to be called from time to time."""
        latest = time.monotonic() - self._limits.idle_seconds
        for name, sketch in tuple(self._all.items()):
            if not sketch.watchers and sketch.touched < latest:
                seconds = f"{self._limits.idle_seconds:g} s"
                self._end(
                    name,
                    NotFoundError(
                        f"the sketch was deleted because nobody drew or watched it for {seconds}; "
                        "create another"
                    ),
                )

    @property
    def _limits(self) -> SketchLimits:
        return self._app.setup.limits.sketches

    def _end(self, name: str, error: SketchmatchError) -> None:
        sketch = self._all.pop(name)
        sketch.board.end(error)
        if sketch.runner is not None:
            sketch.runner.cancel()

    def _check_room(self, caller: Caller) -> None:
        if self._closed:
            raise ServerStoppingError("the server is about to stop")
        theirs = {name: each for name, each in self._all.items() if each.caller.name == caller.name}
        if len(theirs) >= self._limits.of_one:
            self._drop_one(theirs)
        if len(self._all) >= self._limits.sketches:
            raise TooBusyError(f"the server has {_in_progress(self._all)}, which is its limit")

    def _drop_one(self, theirs: dict[str, _Sketch]) -> None:
        """End the sketch that nobody drew or watched for longest, if that is long enough.

        Whoever made it may have ended since, and then nobody knows its name.
        """
        idle = {name: each.touched for name, each in theirs.items() if not each.watchers}
        if not idle:
            raise TooBusyError(
                f"you have {_in_progress(theirs)}, which is the limit for each caller, and watch "
                "all of them; delete one"
            )
        name = min(idle, key=idle.__getitem__)
        seconds = time.monotonic() - idle[name]
        if seconds < _SPARED:
            raise TooBusyError(
                f"you have {_in_progress(theirs)}, which is the limit for each caller; delete one",
                max(1, math.ceil(_SPARED - seconds)),
            )
        self._end(
            name,
            NotFoundError(
                f"the sketch was deleted because nobody drew or watched it for {seconds:.0f} s and "
                "its creator began another one at the limit; create another"
            ),
        )

    def _sketch(self, name: str, caller: Caller) -> _Sketch:
        """Return a sketch of a caller."""
        if not name:
            problem = "is not set; give the sketch_id that CreateSketch returned"
            raise InvalidInputError(Reason.MISSING_FIELD, "sketch_id", problem)
        sketch = self._all.get(name)
        if sketch is None or sketch.caller.known != caller.known:
            raise NotFoundError(
                f"sketch_id is {quoted(name)}, but you have no sketch of this name, or no longer; "
                "create one"
            )
        sketch.touched = time.monotonic()
        return sketch

    def _drawn(self, strokes: dict[str, Stroke], request: UpdateSketchRequest) -> dict[str, Stroke]:
        """Return strokes with some erased and others set."""
        for k, name in enumerate(request.erase_strokes):
            if strokes.pop(name, None) is None:
                raise InvalidInputError(
                    Reason.INVALID_FIELD,
                    f"erase_strokes[{k}]",
                    f"is {quoted(name)}, which is not a stroke of the sketch; name one that is",
                )
        for k, each in enumerate(request.set_strokes):
            if not 1 <= len(each.stroke_id) <= _LONGEST_NAME:
                raise InvalidInputError(
                    Reason.INVALID_FIELD,
                    f"set_strokes[{k}].stroke_id",
                    f"has {len(each.stroke_id)} characters; give 1 to {_LONGEST_NAME} characters",
                )
            _check_points(each.stroke, f"set_strokes[{k}].stroke")
            strokes[each.stroke_id] = _apart(each.stroke)
        if len(strokes) > self._limits.strokes:
            raise _too_large("set_strokes", len(strokes), "strokes", self._limits.strokes)
        points = sum(len(stroke.points) for stroke in strokes.values())
        if points > (most := self._app.setup.engine.limits.max_vertices):
            raise _too_large("set_strokes", points, "points", most)
        return strokes

    async def _run(self, sketch: _Sketch) -> None:
        """Match the latest revision, again and again."""
        while True:
            sketch.changed.clear()
            if sketch.done != sketch.revision:
                revision = sketch.revision
                try:
                    await self._match(sketch, revision)
                except TooBusyError as error:
                    with suppress(TimeoutError):
                        await asyncio.wait_for(sketch.changed.wait(), error.retry_seconds)
                    continue
                except ServerStoppingError:
                    return
                except Exception as error:
                    if not isinstance(error, SketchmatchError):
                        _log.exception("a sketch in progress failed")
                    sketch.board.put("outcome", _problem_event(revision, error))
                sketch.done = revision
            else:
                await sketch.changed.wait()

    async def _match(self, sketch: _Sketch, revision: int) -> None:
        """Match a revision, and tell what comes of it, unless it is overtaken."""
        data = sketch.request()
        if sketch.former is None:
            await self._answer(sketch, revision, data, None)
        elif await self._answer(sketch, revision, data, sketch.former):
            with suppress(TimeoutError):
                await asyncio.wait_for(sketch.changed.wait(), _PEN_RESTS)
            if sketch.revision == revision:
                await _unless_changed(sketch, self._answer(sketch, revision, data, None))

    async def _answer(
        self, sketch: _Sketch, revision: int, data: bytes, former: tuple[bytes, bytes] | None
    ) -> bool:
        """Tell one answer to a revision; return whether it is worth looking for a better one."""
        began, brought, better = time.monotonic(), (sketch.record,), False
        objects = SketchObjects()
        with self._app.running("MatchRequest", data, sketch.caller, brought, former, True) as task:
            async with aclosing(followed(task.log)) as responses:
                async for _, response in responses:
                    taken = time.monotonic() - began
                    if sketch.revision != revision and taken > _OVERTAKEN:
                        return False
                    told = _told(MatchResponse.FromString(response), taken)
                    if told is None:
                        continue
                    place, event = told
                    event.revision = revision
                    sketch.board.put(place, event)
                    if place == "objects":
                        objects = event.objects
                    elif place == "outcome":
                        better = event.result.result.provisional
                        result = event.result.result
                        sketch.former = objects.SerializeToString(), result.SerializeToString()
        return better


async def _unless_changed(sketch: _Sketch, work: Coroutine[Any, Any, bool]) -> None:
    """Do work to its end, or until the sketch is changed: a quick answer is more urgent then."""
    doing, changed = asyncio.create_task(work), asyncio.create_task(sketch.changed.wait())
    try:
        await asyncio.wait((doing, changed), return_when=asyncio.FIRST_COMPLETED)
        if doing.done():
            doing.result()
    finally:
        for each in (doing, changed):
            each.cancel()
        await asyncio.gather(doing, changed, return_exceptions=True)


def question(result: match_pb2.MatchResult) -> SketchQuestion | None:
    """Return the one question that is worth asking about a result; None where there is none.

    It is about the sketched object whose partner tells most about which of the maps that share the
    probability is right.
    """
    deciding = result.ambiguity.deciding_sketch_objects
    if not deciding:
        return None
    asked = deciding[0]
    likely: dict[int, float] = {}
    maps: list[match_pb2.MatchResult | match_pb2.AlternativeMap] = [result]
    maps += [result.alternatives[k] for k in result.ambiguity.alternatives]
    for each in maps:
        partners = {line.sketch_object: line.map_object for line in each.object_matches}
        partner = partners.get(asked, -1)
        likely[partner] = likely.get(partner, 0.0) + each.probability
    total = sum(likely.values())
    if len(likely) < 2 or total <= 0.0:
        return None
    ranked = sorted(likely.items(), key=lambda item: -item[1])
    return SketchQuestion(
        sketch_object=asked,
        options=[
            QuestionOption(
                map_object=None if partner < 0 else partner, probability=probability / total
            )
            for partner, probability in ranked
        ],
    )


def _told(event: MatchResponse, taken: float) -> tuple[str, WatchSketchResponse] | None:
    """Return what a match tells after some seconds, and the place on the board for it."""
    match event.WhichOneof("event"):
        case "scenes":
            found = SketchObjects(
                scene=event.scenes.sketch,
                warnings=event.scenes.sketch_warnings,
                route=event.scenes.sketch_route,
            )
            return "objects", WatchSketchResponse(objects=found)
        case "progress" if taken > _SLOW:
            return "progress", WatchSketchResponse(progress=event.progress)
        case "result":
            result = SketchResult(result=event.result, question=question(event.result))
            return "outcome", WatchSketchResponse(result=result)
    return None


def _check_points(stroke: Stroke, field_: str) -> None:
    for k, point in enumerate(stroke.points):
        if not (math.isfinite(point.x) and math.isfinite(point.y)):
            problem = "is not finite; give plain numbers"
            raise InvalidInputError(Reason.INVALID_STROKE, f"{field_}.points[{k}]", problem)


def _apart(part: _Part) -> _Part:
    """Return a part of a message by itself: as it is, it keeps the whole message in memory."""
    copy = type(part)()
    copy.CopyFrom(part)
    return copy


def _size(part: Stroke | Pin) -> int:
    """Return about how many bytes of memory a message takes."""
    points = len(part.points) if isinstance(part, Stroke) else 0
    return _OF_MESSAGE + _OF_POINT * points + part.ByteSize()


def _map_event(record: StoredScene) -> WatchSketchResponse:
    return WatchSketchResponse(map=SketchMap(scene=record.scene, warnings=record.warnings))


def _problem_event(revision: int, error: Exception) -> WatchSketchResponse:
    unexpected = "the server failed with an unexpected error; its log has the details"
    problem = SketchProblem(message=unexpected)
    if isinstance(error, SketchmatchError):
        problem = SketchProblem(
            reason=getattr(error, "reason", ""),
            field=getattr(error, "field", ""),
            message=str(error),
        )
    return WatchSketchResponse(revision=revision, problem=problem)


def _too_large(field_: str, count: int, what: str, most: int) -> InvalidInputError:
    return InvalidInputError(
        Reason.LIMIT_EXCEEDED,
        field_,
        f"makes {count} {what} in all, more than the limit of {most}; erase some, or draw fewer",
    )


def _in_progress(sketches: Sized) -> str:
    return f"{counted(len(sketches), 'sketch', 'sketches')} in progress"
