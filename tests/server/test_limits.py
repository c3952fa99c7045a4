import grpc
import pytest

from sketchmatch_client import Client, InvalidRequestError, ServerBusyError
from sketchmatch_proto.v1.match_pb2 import OUTCOME_TIME_BUDGET
from tests.pace import within
from tests.server.harness import ENDLESS, scene, serving, when_there_is_room


def assert_serves(client):
    assert client.match(scene(3), scene(3)).object_map == {0: 0, 1: 1, 2: 2}


def test_a_request_more_than_the_server_has_room_for_is_told_when_to_come_again():
    full = {"max_concurrent_matches": 2, "max_waiting": 0}
    with serving(**full) as host, Client(host.address, retries=0) as client:
        running = [client.events(scene(20), scene(20, 1), **ENDLESS) for _ in range(2)]
        for events in running:
            assert next(events).WhichOneof("event") == "accepted"
        for refused in (
            lambda: client.match(scene(3), scene(3)),
            lambda: client.segment(scene(3)),
        ):
            with pytest.raises(ServerBusyError, match="2 requests are running") as raised:
                refused()
            assert raised.value.reason == "LIMIT_EXCEEDED"
            assert raised.value.retry_after == 1.0
            assert raised.value.__cause__.code() is grpc.StatusCode.RESOURCE_EXHAUSTED
        assert client.algorithms().algorithms, "what costs nothing is answered all the same"
        running[0].close()
        when_there_is_room(lambda: assert_serves(client))
        running[1].close()


@pytest.mark.parametrize("method", ["match", "segment"])
def test_a_request_above_the_limit_is_refused_with_the_remedy(method):
    with serving(max_request_bytes=2_000) as host, Client(host.address) as client:
        large = scene(3, labels=["x" * 500] * 3)
        arguments = (large, large) if method == "match" else (scene(3, labels=["x" * 700] * 3),)
        with pytest.raises(InvalidRequestError) as raised:
            getattr(client, method)(*arguments)
        assert raised.value.reason == "MESSAGE_TOO_LARGE"
        assert "more than the limit of 2000; send fewer points" in str(raised.value)
        assert_serves(client)


def test_a_request_that_even_the_transport_refuses_is_a_clear_error_too():
    with serving(max_request_bytes=2_000) as host, Client(host.address) as client:
        with pytest.raises(InvalidRequestError, match="larger than the server at") as raised:
            client.segment(scene(3, labels=["x" * 30_000] * 3))
        assert raised.value.reason == "MESSAGE_TOO_LARGE"
        assert "make it smaller" in str(raised.value)
        assert_serves(client)


@pytest.mark.parametrize("asked", [None, 60.0])
def test_a_longer_time_budget_is_cut_to_the_servers_and_said_so(asked):
    with serving(max_time_budget=0.4) as host, Client(host.address) as client, within(2.0):
        match = client.match(scene(20), scene(20, 1), **ENDLESS, time_budget=asked)
    assert match.accepted.time_budget.ToTimedelta().total_seconds() == 0.4
    assert match.result.outcome == OUTCOME_TIME_BUDGET


def test_a_shorter_time_budget_than_the_servers_holds():
    with serving(max_time_budget=30.0) as host, Client(host.address) as client:
        match = client.match(scene(20), scene(20, 1), **ENDLESS, time_budget=0.3)
    assert match.accepted.time_budget.ToTimedelta().total_seconds() == 0.3
    assert match.result.outcome == OUTCOME_TIME_BUDGET
