"""Over the wire: a match is asked for, watched, cancelled and listed by its own caller."""

import threading
import time

import grpc
import pytest

from sketchmatch.app.setup import Isolation, RequestLimits, Setup
from sketchmatch.errors import InvalidInputError
from sketchmatch.pipeline.engine import Engine
from sketchmatch_client import (
    CallCancelledError,
    Client,
    InvalidRequestError,
    NotFoundError,
    match_request,
)
from sketchmatch_proto.v1.match_service_pb2 import (
    MATCH_STATE_CANCELLED,
    MATCH_STATE_INTERRUPTED,
    MATCH_STATE_QUEUED,
    MATCH_STATE_RUNNING,
    MATCH_STATE_SUCCEEDED,
    GetMatchRequest,
)
from sketchmatch_proto.v1.match_service_pb2_grpc import MatchServiceStub
from tests.pace import wait_until
from tests.server import probes
from tests.server.harness import ENDLESS, hosting, registry_with, scene, serving

RECORDED = {"searcher": "recorded-easm", "params": ENDLESS["params"]}


def offering(*plugins, **limits):
    engine = Engine(registry_with(*plugins))
    limits = {"max_time_budget": 20.0, **limits}
    return Setup(engine, RequestLimits(**limits), Isolation(trusted=frozenset("*")))


@pytest.fixture(scope="module")
def recorded():
    """A server whose searches are counted."""
    with hosting(offering(probes.RecordedEasm)) as host, Client(host.address) as client:
        yield client


@pytest.fixture(autouse=True)
def nothing_recorded():
    for record in (probes.started, probes.ended):
        while not record.empty():
            record.get()


def first(call):
    return next(call).accepted.match_id


def settled(client, name):
    """Wait until a match has ended, and return its state."""
    wait_until(lambda: client.get_match(name).match.HasField("ended_at"), "it never ends")
    return client.get_match(name).match.state


def test_however_many_ask_for_a_match_at_once_it_is_searched_once(recorded):
    found, options = [], {**RECORDED, "request_id": "once", "time_budget": 0.5}

    def ask():
        with recorded.events(scene(8, 0), scene(8, 1), **options) as call:
            found.append([event for event in call if not event.HasField("progress")])

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert probes.started.qsize() == 1
    assert found[0] == found[1] == found[2] == found[3]
    assert [event.WhichOneof("event") for event in found[0]] == ["accepted", "scenes", "result"]
    with pytest.raises(InvalidRequestError, match="already belongs to another request") as no:
        recorded.match(scene(8, 0), scene(8, 2), **options)
    assert no.value.field == "request_id"


def test_what_is_watched_is_the_rest_of_the_stream(recorded):
    with recorded.events(scene(8, 0), scene(8, 1), **RECORDED, time_budget=0.5) as call:
        events = list(call)
    name = events[0].accepted.match_id
    numbers = [event.number for event in events]
    assert numbers == sorted(set(numbers))
    for after in numbers:
        left = [event for event in events if event.number > after]
        kept = [event for event in left if not event.HasField("progress")]
        watched = list(recorded.watch(name, after))
        assert [event for event in watched if not event.HasField("progress")] == kept
        assert all(event.number > after for event in watched)
    found = recorded.get_match(name)
    assert found.match.state == MATCH_STATE_SUCCEEDED
    assert found.match.outcome == events[-1].result.outcome
    assert found.match.last_event == numbers[-1]
    assert found.events[-1] == events[-1]


def test_a_match_keeps_running_without_readers_where_that_was_asked_for(recorded):
    with recorded.events(scene(8, 0), scene(8, 1), **RECORDED, keep_running=True) as call:
        name = first(call)
        probes.started.get(timeout=60)
    time.sleep(0.3)
    assert recorded.get_match(name).match.state == MATCH_STATE_RUNNING
    assert probes.ended.empty()
    with recorded.watch(name) as again:
        assert first(again) == name
    time.sleep(0.1)
    assert recorded.get_match(name).match.state == MATCH_STATE_RUNNING
    assert recorded.cancel_match(name).match_id == name
    probes.ended.get(timeout=60)
    assert settled(recorded, name) == MATCH_STATE_CANCELLED
    with pytest.raises(CallCancelledError, match="the match was cancelled"):
        recorded.watch(name).result()
    assert recorded.cancel_match(name).state == MATCH_STATE_CANCELLED


def test_without_it_the_last_reader_stops_it(recorded):
    with recorded.events(scene(8, 0), scene(8, 1), **RECORDED) as call:
        name = first(call)
        probes.started.get(timeout=60)
        with recorded.watch(name) as other:
            first(other)
            call.close()
            time.sleep(0.3)
            assert probes.ended.empty()
    probes.ended.get(timeout=60)
    assert settled(recorded, name) == MATCH_STATE_INTERRUPTED


def test_what_waits_is_queued_and_can_be_cancelled():
    errors = []

    def wait(waiting):
        with pytest.raises(CallCancelledError) as raised:
            next(waiting)
        errors.append(raised.value)

    with (
        serving(max_concurrent_matches=1) as host,
        Client(host.address) as client,
        client.events(scene(8, 0), scene(8, 1), **ENDLESS) as runs,
    ):
        first(runs)
        waiting = client.events(scene(8, 0), scene(8, 1), request_id="waits")
        thread = threading.Thread(target=wait, args=[waiting])
        thread.start()

        def queued():
            return [match for match in client.matches() if match.request_id == "waits"]

        wait_until(queued, "it does not wait")
        assert queued()[0].state == MATCH_STATE_QUEUED
        assert client.cancel_match(queued()[0].match_id).state == MATCH_STATE_CANCELLED
        thread.join(60)
    assert [error.reason for error in errors] == ["MATCH_CANCELLED"]


def test_a_match_that_is_not_there_is_not_found(recorded):
    for call in (
        recorded.get_match,
        recorded.cancel_match,
        lambda name: next(recorded.watch(name)),
    ):
        with pytest.raises(NotFoundError, match="no match 'nobody'"):
            call("nobody")
        with pytest.raises(InvalidRequestError, match="match_id is not set"):
            call("")


def test_matches_are_listed_page_by_page(recorded):
    names = [recorded.match(scene(4, k), scene(4, k)).accepted.match_id for k in range(3)]
    stub, listed = MatchServiceStub(recorded._channel), [m.match_id for m in recorded.matches()]
    assert [name for name in listed if name in names] == names[::-1]
    assert stub.GetMatch(GetMatchRequest(match_id=names[0])).match.match_id == names[0]


def test_a_server_started_anew_has_what_was_finished(tmp_path):
    with hosting(offering(), store=tmp_path) as host, Client(host.address) as client:
        match = client.match(scene(6, 0), scene(6, 1), request_id="kept")
        name = match.accepted.match_id
        before = client.get_match(name)
        with pytest.raises(InvalidInputError, match=r"cannot be used: the store .* is used by"):
            hosting(offering(), store=tmp_path).__enter__()
    with hosting(offering(), store=tmp_path) as host, Client(host.address) as client:
        assert client.get_match(name) == before
        assert client.watch(name).result().result == match.result
        again = client.match(scene(6, 0), scene(6, 1), request_id="kept")
        assert again.result == match.result
        assert [found.match_id for found in client.matches()] == [name]


def test_a_default_folder_that_another_server_uses_is_left_to_it_and_said(tmp_path):
    with (
        hosting(offering(), store=tmp_path),
        hosting(offering(), store=tmp_path, store_named=False) as second,
        Client(second.address) as client,
    ):
        assert any("nothing is kept after" in said and "used by" in said for said in second.said)
        name = client.match(scene(4, 0), scene(4, 1)).accepted.match_id
        assert client.get_match(name).match.state == MATCH_STATE_SUCCEEDED


def test_a_request_of_gzip_is_known_by_its_name_too(recorded):
    request = match_request(scene(6, 0), scene(6, 1))
    request.request_id = "packed"
    stub = MatchServiceStub(recorded._channel)
    plain = list(stub.Match(request))
    packed = list(stub.Match(request, compression=grpc.Compression.Gzip))
    # Of progress who comes late is told the latest alone.
    without_progress = [
        [each for each in read if not each.HasField("progress")] for read in (plain, packed)
    ]
    assert without_progress[0] == without_progress[1]
    assert [each.WhichOneof("event") for each in without_progress[1]] == [
        "accepted",
        "scenes",
        "result",
    ]
