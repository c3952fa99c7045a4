"""Requests in the application, without any transport: admitted, done, followed, stopped."""

import asyncio
import contextlib
import functools
import inspect
import math
import pickle
import threading
import time

import pytest

from sketchmatch.api import Outcome, Searcher, SearchProgress
from sketchmatch.app.application import Application
from sketchmatch.app.jobs import Job, algorithms
from sketchmatch.app.orders import Order
from sketchmatch.app.setup import Isolation, RequestLimits, Setup
from sketchmatch.app.tasks import Task
from sketchmatch.app.waiting import Caller
from sketchmatch.errors import (
    InvalidInputError,
    PluginError,
    Reason,
    ServerStoppingError,
    TooBusyError,
)
from sketchmatch.model import Fmap
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.selection import Choice, Defaults, Profile
from sketchmatch.registry import Kind, Registered, Registry, default_registry
from sketchmatch_client import match_request, segment_request, sources
from sketchmatch_proto.v1.match_pb2 import OUTCOME_SERVER_STOPPING
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse
from sketchmatch_proto.v1.sketch_service_pb2 import CreateSketchRequest
from tests.pace import within

SQUARE = [[0, 0], [2, 0], [2, 2], [0, 2]]
SCENE = sources.polygons([SQUARE, [[5, 0], [9, 0], [9, 1]], [[1, 6], [2, 6], [2, 7]]])


class Held(Searcher):
    """Goes on until it is let go or stopped."""

    name = "held"
    summary = "Goes on until it is let go."
    go = threading.Event()
    began = threading.Event()
    stopped = threading.Event()

    def search(self, problem, rng):  # noqa: ARG002
        fmap = Fmap(list(range(problem.table.template_pairs)))
        confidence = 1.0
        try:
            self.began.set()
            while not self.go.is_set():
                yield SearchProgress(fmap, confidence, 1, 1)
                time.sleep(0.001)
        except GeneratorExit:
            self.stopped.set()
            raise
        yield SearchProgress(fmap, confidence, 2, 2)
        return Outcome.CONVERGED


@pytest.fixture
def held():
    Held.go.clear()
    Held.began.clear()
    Held.stopped.clear()
    yield match_request(SCENE, SCENE, searcher="held")
    Held.go.set()


def setup(isolation=None, **limits):
    offered = Registered(Kind.SEARCHER, Held, "acme-plugins", "1.2")
    registry = Registry([*default_registry().algorithms, offered])
    return Setup(Engine(registry), RequestLimits(**limits), isolation or Isolation(frozenset("*")))


def in_loop(test):
    """Run a test that is a coroutine of an application's, without workers."""

    @functools.wraps(test)
    def run(**given):
        limits = getattr(test, "limits", {})

        async def running():
            app = Application(setup(**limits))
            await app.start(lambda _: None)
            try:
                await test(app, **given)
            finally:
                Held.go.set()
                await app.close()

        asyncio.run(running())

    signature = inspect.signature(test)
    run.__signature__ = signature.replace(parameters=list(signature.parameters.values())[1:])
    return run


def limited(**limits):
    def mark(test):
        test.limits = limits
        return test

    return mark


def begun(app, request, caller=Caller()):  # noqa: B008
    return app.running(request.DESCRIPTOR.name, request.SerializeToString(), caller)


async def until(condition, complaint):
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline, complaint
        await asyncio.sleep(0.005)


async def ended(task):
    """Wait until a task has ended, and return its responses."""
    await until(lambda: task.log.ended, "the task does not end")
    told, seen = [], 0
    while (found := task.log.next(seen)) is not None:
        seen, response = found
        told.append(MatchResponse.FromString(response))
    return told


def kinds(responses):
    return [response.WhichOneof("event") for response in responses]


@in_loop
async def test_a_task_tells_what_a_match_does_under_the_name_that_it_was_admitted_with(app):
    with begun(app, match_request(SCENE, SCENE)) as task:
        told = await ended(task)
    assert [kind for kind in kinds(told) if kind != "progress"] == ["accepted", "scenes", "result"]
    assert told[0].accepted.match_id == task.id


@in_loop
async def test_the_same_request_is_answered_alike_in_this_thread(app):
    request = match_request(SCENE, SCENE, seed=3)
    *_, last = app.answers(request)
    with begun(app, request) as task:
        *_, here = await ended(task)
    for each in (last, here):
        each.result.ClearField("match_id")
        each.result.ClearField("statistics")
    assert last == here


@in_loop
@limited(max_concurrent_matches=1, max_waiting=0)
async def test_a_place_is_taken_until_the_work_has_ended_even_if_nobody_waits_for_it(app, held):
    with begun(app, held):
        with pytest.raises(TooBusyError, match="1 request is running") as refused:
            begun(app, held).__enter__()
        assert refused.value.reason is Reason.LIMIT_EXCEEDED
        await until(Held.began.is_set, "the search does not begin")
    await until(Held.stopped.is_set, "the search is not stopped")
    await until(lambda: app.idle, "the place is never given back")
    with begun(app, match_request(SCENE, SCENE)) as task:
        assert kinds(await ended(task))[-1] == "result"


@in_loop
@limited(max_concurrent_matches=1)
async def test_what_waits_begins_when_there_is_a_place_and_whoever_leaves_does_not_wait(app, held):
    small = match_request(SCENE, SCENE)
    with begun(app, held) as first, begun(app, small) as second:
        with begun(app, small) as third:
            await asyncio.sleep(0.05)
        assert third.log.ended
        assert not third.log.begun
        assert not second.log.begun
        Held.go.set()
        assert kinds(await ended(second))[-1] == "result"
        assert kinds(await ended(first))[-1] == "result"
    assert app.idle


@in_loop
@limited(max_concurrent_matches=1, max_waiting=3)
async def test_callers_take_turns_and_a_full_queue_loses_the_last_of_the_greediest(app, held):
    small = match_request(SCENE, SCENE)
    flood, polite = Caller("flood", "1"), Caller("polite", "1")
    with contextlib.ExitStack() as stack:
        stack.enter_context(begun(app, held, flood))
        waiting = [stack.enter_context(begun(app, small, flood)) for _ in range(3)]
        with pytest.raises(TooBusyError, match="1 request is running and 3 are waiting"):
            begun(app, small, flood).__enter__()
        last = stack.enter_context(begun(app, small, polite))
        with pytest.raises(TooBusyError, match="3 are waiting"):
            waiting[2].log.check()
        Held.go.set()
        for task in (*waiting[:2], last):
            assert kinds(await ended(task))[-1] == "result"
        assert waiting[0].begun < last.begun < waiting[1].begun


def padded(size):
    """Return a request of so many bytes, by a label as long as that takes."""
    request = match_request(SCENE, SCENE)
    label = request.map.polygon_set.polygons[0]
    while (lacking := size - request.ByteSize()) != 0:
        label.label = "x" * (len(label.label) + lacking)
    return request.SerializeToString()


@in_loop
@limited(max_concurrent_matches=1, max_waiting_bytes=100_000)
async def test_what_waits_is_bounded_in_bytes_and_the_greediest_by_bytes_loses_its_last(app, held):
    large, polite = Caller("large", "1"), Caller("polite", "1")

    def waiting(size, caller):
        return app.running("MatchRequest", padded(size), caller)

    with contextlib.ExitStack() as stack:
        stack.enter_context(begun(app, held, large))
        first = stack.enter_context(waiting(50_000, large))
        second = stack.enter_context(waiting(40_000, large))
        with pytest.raises(TooBusyError, match="ones would have more than 100000 bytes") as refused:
            waiting(20_000, large).__enter__()
        assert 1 <= refused.value.retry_seconds <= 60
        for _ in range(20):  # by number this caller has most
            stack.enter_context(waiting(600, polite))
        with pytest.raises(TooBusyError, match="ones would have more than 100000 bytes"):
            second.log.check()
        assert not first.log.ended
        await until(lambda: app.load == (1, 21, 62_000, 0, 0), "the load is not told")
        Held.go.set()
        assert kinds(await ended(first))[-1] == "result"
    await until(lambda: app.load == (0, 0, 0, 0, 0), "the load is not told")


@in_loop
@limited(max_concurrent_matches=1, max_waiting_bytes=100_000)
async def test_what_would_not_even_fit_alone_waits_for_no_place_and_takes_one_that_is_free(
    app, held
):
    with begun(app, held), begun(app, match_request(SCENE, SCENE)) as waiting:
        with pytest.raises(TooBusyError, match="100000 bytes together"):
            app.running("MatchRequest", padded(100_001)).__enter__()
        Held.go.set()
        assert kinds(await ended(waiting))[-1] == "result"
    await until(lambda: app.idle, "the place is never given back")
    with app.running("MatchRequest", padded(100_001)) as task:
        assert kinds(await ended(task))[-1] == "result"


@in_loop
@limited(max_concurrent_matches=1, max_wait=0.2)
async def test_who_waits_too_long_is_told_when_to_come_again(app, held):
    with begun(app, held), begun(app, match_request(SCENE, SCENE)) as late:
        assert await ended(late) == []
        with pytest.raises(TooBusyError, match=r"waited 0\.2 s for its turn") as refused:
            late.log.check()
    assert 1 <= refused.value.retry_seconds <= 60


@in_loop
async def test_leaving_the_block_stops_the_search(app, held):
    with begun(app, held):
        assert not app.idle
        await until(Held.began.is_set, "the search does not begin")
    await until(Held.stopped.is_set, "the search is not stopped")
    await until(lambda: app.idle, "the place is never given back")


@in_loop
async def test_closing_stops_what_runs_and_waits_for_it(app, held):
    with begun(app, held) as one, begun(app, held) as other:
        await until(lambda: one.log.begun and other.log.begun, "nothing runs")
        await app.close()
        assert one.log.ended
        assert other.log.ended


@in_loop
@limited(max_concurrent_matches=1)
async def test_draining_ends_what_runs_with_its_best_so_far_and_begins_nothing(app, held):
    with begun(app, held) as running, begun(app, match_request(SCENE, SCENE)) as waiting:
        await until(Held.began.is_set, "the search does not begin")
        await app.drain(0.1)
        result = (await ended(running))[-1].result
        assert result.outcome == OUTCOME_SERVER_STOPPING
        assert len(result.object_matches) == 3
        assert await ended(waiting) == []
        with pytest.raises(ServerStoppingError):
            waiting.log.check()
    with pytest.raises(ServerStoppingError, match="about to stop; send the request again in 1 s"):
        begun(app, held).__enter__()


@in_loop
async def test_draining_waits_no_longer_than_what_runs(app):
    with begun(app, match_request(SCENE, SCENE)) as task, within(10.0):
        await app.drain(60.0)
        assert (await ended(task))[-1].result.outcome != OUTCOME_SERVER_STOPPING


@in_loop
async def test_a_request_of_exactly_the_limit_passes_and_one_byte_more_does_not(app):
    request = segment_request(SCENE)
    app.change(setup(max_request_bytes=request.ByteSize()))
    with begun(app, request) as task:
        await until(lambda: task.log.ended, "the task does not end")
        task.log.check()
    app.change(setup(max_request_bytes=request.ByteSize() - 1))
    with pytest.raises(InvalidInputError) as refused:
        begun(app, request).__enter__()
    assert refused.value.reason is Reason.MESSAGE_TOO_LARGE


@in_loop
async def test_an_error_is_what_the_log_ends_with(app):
    with begun(app, match_request(SCENE, SCENE, searcher="nobody")) as task:
        assert await ended(task) == []
        with pytest.raises(InvalidInputError, match="not a searcher") as refused:
            task.log.check()
    assert refused.value.field == "pipeline.searcher.name"


@pytest.mark.parametrize(
    ("request_", "named"),
    [
        (
            match_request(SCENE, SCENE),
            {"polygons", "align", "constant", "cross-correlation", "posterior"},
        ),
        (
            match_request(SCENE, sources.strokes([SQUARE]), searcher="held"),
            {"polygons", "strokes", "held", "constant", "cross-correlation", "posterior"},
        ),
        (segment_request(sources.image(b"no picture")), {"image"}),
    ],
)
def test_whose_algorithms_are_asked_for_is_told_without_decoding_anything(request_, named):
    order = Order("", request_.DESCRIPTOR.name, request_.SerializeToString())
    for job in (Job("", request_), order.outline(1_000_000)):
        assert {item.name for item in algorithms(job, setup())} == named


@pytest.mark.parametrize(
    ("request_", "field"),
    [
        (match_request(SCENE, SCENE, searcher="nobody"), "pipeline.searcher.name"),
        (match_request(SCENE, SCENE, searcher="held", judge="nobody"), "pipeline.judge.name"),
        (match_request(SCENE, SCENE, profile="nobody"), "pipeline.profile"),
        (segment_request(SCENE, segmenter="nobody"), "segmenter.name"),
        (match_request(SCENE, sources.file(b"", name="map.plan")), "map.file"),
        (segment_request(sources.file(b"", name="map.plan")), "source.file"),
        (
            CreateSketchRequest(match=match_request(SCENE, SCENE, searcher="nobody")),
            "match.pipeline.searcher.name",
        ),
    ],
)
def test_a_name_of_no_use_is_refused_by_whoever_knows_all_plugins(request_, field):
    order = Order("", request_.DESCRIPTOR.name, request_.SerializeToString())
    task = Task(order, setup())
    assert task.refusal.field == field
    assert ("held" in str(task.refusal)) == (field.endswith("searcher.name"))


def test_what_a_profile_names_is_asked_for_though_the_request_names_another():
    defaults = Defaults(profiles=(Profile("mine", "", {"searcher": Choice("held")}),))
    given = Setup(Engine(setup().engine.registry, defaults))
    order = match_request(SCENE, SCENE, profile="mine", searcher="align")
    names = {item.name for item in algorithms(Job("", order), given)}
    assert {"align", "held"} <= names, "or the worker, which checks the profile, knows it not"


def test_errors_survive_the_way_between_processes():
    error = InvalidInputError(Reason.INVALID_STROKE, "strokes[3]", "has one point; draw a line")
    copy = pickle.loads(pickle.dumps(error))
    assert (copy.reason, copy.field, copy.problem) == (error.reason, error.field, error.problem)
    assert str(copy) == str(error)
    assert str(pickle.loads(pickle.dumps(PluginError("it failed")))) == "it failed"
    busy = pickle.loads(pickle.dumps(TooBusyError("it is full", 7)))
    assert str(busy) == "it is full; send the request again in 7 s"


def test_what_is_expected_to_be_long_begins_beside_short_ones_and_leaves_them_their_places():
    fine = [[math.cos(k / 500), math.sin(k / 500)] for k in range(3000)]
    large, small = match_request(sources.polygons([fine]), SCENE), match_request(SCENE, SCENE)

    async def run():
        app = Application(setup(max_concurrent_matches=5), workers=2)
        given = []
        app._workers.begin = given.append
        with contextlib.ExitStack() as stack:
            for request in (large, large, large, large, small, small, small):
                stack.enter_context(begun(app, request))
            assert [task.long for task in given] == [True, True, True, False, False]
            app._ended(given[0], None)
            assert [task.long for task in given[5:]] == [True]
            app._ended(given[3], None)
            assert [task.long for task in given[6:]] == [False]
        for task in (given[1], given[2], *given[4:]):
            app._ended(task, None)
        await app.close()

    asyncio.run(run())
