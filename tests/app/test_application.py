"""Requests in the application, without any transport: admitted, done, followed, stopped."""

import pickle
import threading
import time

import pytest

from sketchmatch.api import Outcome, Searcher, SearchProgress
from sketchmatch.app.application import Application
from sketchmatch.app.jobs import Job, algorithms
from sketchmatch.app.setup import Isolation, RequestLimits, Setup
from sketchmatch.errors import InvalidInputError, PluginError, Reason, TooBusyError
from sketchmatch.model import Fmap
from sketchmatch.pipeline.engine import Engine
from sketchmatch.registry import Kind, Registered, Registry, default_registry
from sketchmatch_client import match_request, segment_request, sources
from tests.pace import wait_until

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


def application(isolation=None, **limits):
    offered = Registered(Kind.SEARCHER, Held, "acme-plugins", "1.2")
    registry = Registry([*default_registry().algorithms, offered])
    setup = Setup(Engine(registry), RequestLimits(**limits), isolation or Isolation(frozenset("*")))
    return Application(setup)


def ended(task):
    """Wait until a task has ended, and return the kinds of its responses."""
    wait_until(lambda: task.log.ended, "the task does not end")
    kinds, seen = [], 0
    while (found := task.log.next(seen)) is not None:
        seen, response = found
        kinds.append(response.WhichOneof("event"))
    return kinds


def test_a_task_tells_what_a_match_does_under_the_name_that_it_was_admitted_with():
    app = application()
    with app.running(match_request(SCENE, SCENE)) as task:
        kinds = [kind for kind in ended(task) if kind != "progress"]
    assert kinds == ["accepted", "scenes", "result"]
    assert task.log.next(0)[1].accepted.match_id == task.id
    app.close()


def test_the_same_request_is_answered_alike_in_this_thread():
    app, request = application(), match_request(SCENE, SCENE, seed=3)
    *_, last = app.answers(request)
    with app.running(request) as task:
        ended(task)
        here = dict(task.log._kept)[max(dict(task.log._kept))]
    for each in (last, here):
        each.result.ClearField("match_id")
        each.result.ClearField("statistics")
    assert last == here
    app.close()


def test_a_place_is_taken_until_the_work_has_ended_even_if_nobody_waits_for_it(held):
    app = application(max_concurrent_matches=1)
    with app.running(held):
        with pytest.raises(TooBusyError, match="runs 1 requests already") as refused:
            app.running(held).__enter__()
        assert refused.value.reason is Reason.LIMIT_EXCEEDED
        wait_until(Held.began.is_set, "the search does not begin")
    wait_until(Held.stopped.is_set, "the search is not stopped")

    def admitted():
        try:
            with app.running(match_request(SCENE, SCENE)) as task:
                return ended(task)
        except TooBusyError:
            return None

    wait_until(admitted, "the place is never given back")
    app.close()


def test_leaving_the_block_stops_the_search(held):
    app = application()
    with app.running(held):
        assert not app.idle
        wait_until(Held.began.is_set, "the search does not begin")
    assert app.idle
    wait_until(Held.stopped.is_set, "the search is not stopped")
    app.close()


def test_closing_stops_what_runs_and_waits_for_it(held):
    app = application()
    with app.running(held) as one, app.running(held) as other:
        wait_until(lambda: one.log.next(0) and other.log.next(0), "nothing runs")
        app.close()
        assert one.log.ended
        assert other.log.ended


def test_a_request_of_exactly_the_limit_passes_and_one_byte_more_does_not():
    request = segment_request(SCENE)
    app = application(max_request_bytes=request.ByteSize())
    with app.running(request) as task:
        wait_until(lambda: task.log.ended, "the task does not end")
    app.change(application(max_request_bytes=request.ByteSize() - 1).setup)
    with pytest.raises(InvalidInputError) as refused:
        app.running(request).__enter__()
    assert refused.value.reason is Reason.MESSAGE_TOO_LARGE
    app.close()


def test_an_error_is_what_the_log_ends_with():
    app = application()
    with app.running(match_request(SCENE, SCENE, searcher="nobody")) as task:
        assert ended(task) == []
        with pytest.raises(InvalidInputError, match="no searcher") as refused:
            task.log.check()
    assert refused.value.field == "pipeline.searcher.name"
    app.close()


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
        (match_request(SCENE, SCENE, searcher="nobody"), set()),
    ],
)
def test_whose_algorithms_are_asked_for_is_told_without_decoding_anything(request_, named):
    app = application()
    assert {item.name for item in algorithms(Job("", request_), app.setup)} == named


def test_errors_survive_the_way_between_processes():
    error = InvalidInputError(Reason.INVALID_STROKE, "strokes[3]", "has one point; draw a line")
    copy = pickle.loads(pickle.dumps(error))
    assert (copy.reason, copy.field, copy.problem) == (error.reason, error.field, error.problem)
    assert str(copy) == str(error)
    assert str(pickle.loads(pickle.dumps(PluginError("it failed")))) == "it failed"


def test_the_catalogue_is_put_together_once_for_each_setup():
    app = application()
    first = app.algorithms()
    assert app.algorithms() is first
    app.change(Setup(Engine(default_registry())))
    assert app.algorithms() is app.algorithms()
    assert {algorithm.name for algorithm in first.algorithms} - {
        algorithm.name for algorithm in app.algorithms().algorithms
    } == {"held"}
    app.close()
