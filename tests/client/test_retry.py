"""A request is sent again where that helps: with pauses that grow, and no sooner than asked."""

import threading
import time

import grpc
import pytest
from google.protobuf import duration_pb2
from google.rpc import error_details_pb2

from sketchmatch_client import Client, sources
from sketchmatch_client._retry import Attempts
from sketchmatch_client.errors import (
    CallCancelledError,
    DeadlineExceededError,
    InvalidRequestError,
    NotFoundError,
    ServerBusyError,
    ServerFailedError,
    ServerUnavailableError,
)

SKETCH = sources.polygons([[(0, 0), (1, 0), (1, 1)], [(5, 5), (6, 5), (6, 6)]])
METHODS = {
    "match": (SKETCH, SKETCH),
    "events": (SKETCH, SKETCH),
    "segment": (SKETCH,),
    "algorithms": (),
    "server_info": (),
}
AWAY = ServerUnavailableError("away")


def come_back_in(seconds):
    delay = duration_pb2.Duration()
    delay.FromMilliseconds(round(1000 * seconds))
    return error_details_pb2.RetryInfo(retry_delay=delay)


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_a_server_that_was_away_for_a_moment_is_asked_again(call, server, method):
    server.fail(grpc.StatusCode.UNAVAILABLE, "away")
    server.fails = 2
    assert call(server.address, method, *METHODS[method], retries=2)
    first, *again = server.requests
    assert len(again) == 2
    assert all(request == first for request in again)


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_a_busy_server_is_asked_again_no_sooner_than_it_says(call, server, method):
    server.fail(grpc.StatusCode.RESOURCE_EXHAUSTED, "full", come_back_in(0.4))
    server.fails = 1
    began = time.monotonic()
    assert call(server.address, method, *METHODS[method], retries=1)
    assert time.monotonic() - began >= 0.4
    assert len(server.requests) == 2


def test_it_is_told_in_the_end_if_nothing_helped(call, server):
    server.fail(grpc.StatusCode.UNAVAILABLE, "away")
    with pytest.raises(ServerUnavailableError):
        call(server.address, "match", SKETCH, SKETCH, retries=2)
    assert len(server.requests) == 3


@pytest.mark.parametrize(
    ("code", "error"),
    [
        (grpc.StatusCode.INVALID_ARGUMENT, InvalidRequestError),
        (grpc.StatusCode.RESOURCE_EXHAUSTED, ServerBusyError),  # which says not when
        (grpc.StatusCode.INTERNAL, ServerFailedError),
        (grpc.StatusCode.DEADLINE_EXCEEDED, DeadlineExceededError),
    ],
)
def test_what_would_fail_again_is_not_sent_again(call, server, code, error):
    server.fail(code, "no")
    with pytest.raises(error):
        call(server.address, "match", SKETCH, SKETCH, retries=3)
    assert len(server.requests) == 1


def test_a_match_that_has_begun_is_not_sent_again(call, server):
    server.events, server.breaks_off = server.events[:1], True
    with pytest.raises(ServerUnavailableError):
        call(server.address, "match", SKETCH, SKETCH, retries=3)
    assert len(server.requests) == 1


def test_a_scene_that_is_gone_when_its_deletion_is_sent_again_is_deleted(call, server):
    with pytest.raises(NotFoundError):
        call(server.address, "delete_scene", "ab" * 32, retries=1)
    server.requests.clear()
    server.fail(grpc.StatusCode.UNAVAILABLE, "away")
    server.fails = 1
    assert call(server.address, "delete_scene", "ab" * 32, retries=1) is None
    assert len(server.requests) == 2


def test_a_pause_beyond_the_timeout_is_not_waited_for(call, server):
    server.fail(grpc.StatusCode.RESOURCE_EXHAUSTED, "full", come_back_in(30))
    with pytest.raises(ServerBusyError):
        call(server.address, "match", SKETCH, SKETCH, retries=3, timeout=20)
    assert len(server.requests) == 1


def test_a_match_can_be_cancelled_while_it_waits_to_be_sent_again(server):
    server.fail(grpc.StatusCode.RESOURCE_EXHAUSTED, "full", come_back_in(600))
    with Client(server.address) as client:
        waiting = client.events(SKETCH, SKETCH)
        errors = []

        def wait():
            with pytest.raises(CallCancelledError) as raised:
                waiting.result()
            errors.append(raised.value)

        thread = threading.Thread(target=wait)
        thread.start()
        while not server.requests:
            time.sleep(0.01)
        time.sleep(0.1)
        waiting.cancel()
        thread.join(20)
    assert errors
    assert len(server.requests) == 1


def test_pauses_grow_and_are_no_shorter_than_asked():
    attempts = Attempts(4, None)
    pauses = [attempts.pause_after(AWAY) for _ in range(4)]
    for shortest, pause in zip((0.1, 0.2, 0.4, 0.8), pauses, strict=True):
        assert shortest <= pause <= 1.5 * shortest
    assert attempts.pause_after(AWAY) is None
    assert 7.0 <= Attempts(1, None).pause_after(ServerBusyError("full", "", 7.0)) <= 10.5


def test_pauses_differ_from_caller_to_caller():
    assert len({Attempts(1, None).pause_after(AWAY) for _ in range(10)}) > 1


def test_attempts_share_the_time():
    attempts = Attempts(3, 5.0)
    first = attempts.limit
    time.sleep(0.01)
    assert attempts.limit < first <= 5.0
    assert Attempts(3, None).limit is None
    assert Attempts(3, 0.05).pause_after(AWAY) is None


@pytest.mark.parametrize("retries", [-1, 1.5, "many", None])
def test_what_is_no_number_of_retries_is_refused(call, nobody_needed, retries):
    with pytest.raises(InvalidRequestError, match="give how often a request may be sent") as no:
        call(nobody_needed, "server_info", retries=retries)
    assert no.value.field == "retries"


@pytest.fixture
def nobody_needed():
    return "localhost:1"
