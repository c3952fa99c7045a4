"""A match under way, in the hands of several threads."""

from contextlib import closing, contextmanager
from threading import Event, Thread

import grpc
import pytest

from sketchmatch_client import (
    CallCancelledError,
    Client,
    DeadlineExceededError,
    InvalidRequestError,
    sources,
)
from tests.client.fake_server import EVENTS, reason

TRIANGLE = [(0, 0), (2, 0), (2, 1)]
SKETCH = MAP = sources.polygons([TRIANGLE, TRIANGLE])


@pytest.fixture
def client(server):
    with Client(server.address, timeout=60) as connected:
        yield connected


@pytest.fixture
def endless(client, server):
    """A match that would never end."""
    server.events, server.endless = EVENTS[:3], True
    with client.events(SKETCH, MAP) as call:
        yield call


@contextmanager
def another_thread(action):
    """Yield an event, after which another thread does something."""
    event = Event()
    thread = Thread(target=lambda: (event.wait(60), action()))
    thread.start()
    try:
        yield event
    finally:
        event.set()
        thread.join()


def test_another_thread_cancels_who_waits_for_the_result(endless, server):
    with (
        another_thread(endless.cancel) as begun,
        pytest.raises(CallCancelledError, match="was cancelled before its end"),
    ):
        endless.result(on_progress=lambda _progress: begun.set())
    assert server.cancelled.wait(5)


def test_another_thread_cancels_who_goes_through_the_events(endless, server):
    def go_through(begun):
        for _event in endless:
            begun.set()

    with (
        another_thread(endless.cancel) as begun,
        pytest.raises(CallCancelledError, match="was cancelled before its end"),
    ):
        go_through(begun)
    assert server.cancelled.wait(5)
    with pytest.raises(CallCancelledError):
        next(endless)


def test_who_calls_back_may_cancel(endless, server):
    with pytest.raises(CallCancelledError, match="was cancelled before its end"):
        endless.result(on_progress=lambda _progress: endless.cancel())
    assert server.cancelled.wait(5)


def test_what_is_cancelled_before_it_began_is_never_sent(client, server):
    call = client.events(SKETCH, MAP)
    call.cancel()
    with pytest.raises(CallCancelledError):
        next(call)
    with pytest.raises(CallCancelledError):
        call.result()
    assert not server.requests


def test_what_has_ended_is_no_longer_cancelled(client):
    call = client.events(SKETCH, MAP)
    match = call.result()
    call.cancel()
    assert call.result() == match
    assert match.result == EVENTS[-1].result
    assert list(call) == []


def test_the_result_holds_what_came_before_it_was_asked_for(client):
    call = client.events(SKETCH, MAP)
    assert [next(call), next(call)] == list(EVENTS[:2])
    match = call.result()
    assert (match.accepted, match.scenes) == (EVENTS[0].accepted, EVENTS[1].scenes)


def test_another_thread_closes_and_the_loop_comes_to_its_end(endless, server):
    with another_thread(endless.close) as begun:
        for _event in endless:
            begun.set()
    assert begun.is_set()
    assert server.cancelled.wait(5)
    with pytest.raises(CallCancelledError, match="was closed before its end"):
        endless.result()


def test_leaving_the_block_cancels(client, server):
    server.endless = True
    with client.events(SKETCH, MAP) as call:
        next(call)
        assert not server.cancelled.is_set()
    assert server.cancelled.wait(5)


def test_an_error_thrown_into_it_cancels(endless, server):
    next(endless)
    with pytest.raises(RuntimeError, match="enough"):
        endless.throw(RuntimeError("enough"))
    assert server.cancelled.wait(5)


def test_a_generator_can_hand_it_on(client):
    def through():
        yield from client.events(SKETCH, MAP)

    with closing(through()) as events:
        assert list(events) == list(EVENTS)


def test_what_ended_it_is_said_again(client, server):
    server.fail(grpc.StatusCode.INVALID_ARGUMENT, "no", reason("INVALID_IMAGE"))
    call = client.events(SKETCH, MAP)
    for ask in (call.result, call.result, lambda: next(call)):
        with pytest.raises(InvalidRequestError, match="no"):
            ask()
    assert len(server.requests) == 1


def test_a_timeout_ends_it(client, server):
    server.endless = True
    call = client.events(SKETCH, MAP, timeout=0.2)
    with pytest.raises(DeadlineExceededError):
        call.result()
