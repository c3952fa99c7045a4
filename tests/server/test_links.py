"""Callers that freeze or vanish, and callers that all come at once."""

import signal
import subprocess
import sys
import time
from contextlib import ExitStack

import grpc
import pytest

from sketchmatch.server import serve
from sketchmatch_client import Client, DeadlineExceededError, ServerBusyError
from sketchmatch_proto.v1.catalog_service_pb2 import GetServerInfoRequest
from sketchmatch_proto.v1.catalog_service_pb2_grpc import CatalogServiceStub
from tests.pace import wait_until, within
from tests.server.harness import ENDLESS, _loop, scene, serving, when_there_is_room

OWN = [("grpc.use_local_subchannel_pool", 1)]
"""A connection of its own for each channel."""
ONE_THAT_WAITS = """
import sys
from sketchmatch_client import Client
from tests.server.harness import ENDLESS, scene
with Client(sys.argv[1]) as client:
    for event in client.events(scene(8), scene(8, 1), **ENDLESS):
        print(event.WhichOneof("event"), flush=True)
"""


@pytest.mark.slow
def test_a_caller_that_is_frozen_gives_its_place_back(monkeypatch):
    monkeypatch.setattr(serve, "_PING_MS", 400)
    with serving(max_concurrent_matches=1, max_waiting=0, max_time_budget=600.0) as host:
        frozen = subprocess.Popen(
            [sys.executable, "-c", ONE_THAT_WAITS, host.address], stdout=subprocess.PIPE, text=True
        )
        try:
            assert frozen.stdout.readline() == "accepted\n"
            frozen.send_signal(signal.SIGSTOP)
            with Client(host.address, retries=0) as client, within(20.0):
                with pytest.raises(ServerBusyError):
                    client.segment(scene(3))
                when_there_is_room(lambda: client.segment(scene(3)), 60.0)
        finally:
            frozen.kill()
            frozen.communicate()


@pytest.mark.slow
def test_of_thousands_of_calls_at_once_none_is_dropped():
    with serving(warm=False) as host, ExitStack() as connected:
        stubs = [
            CatalogServiceStub(connected.enter_context(grpc.insecure_channel(host.address, OWN)))
            for _ in range(5)
        ]
        # While it is busy otherwise they pile up inside gRPC.
        _loop().call_soon_threadsafe(time.sleep, 1.5)
        calls = [
            stub.GetServerInfo.future(GetServerInfoRequest()) for _ in range(400) for stub in stubs
        ]
        answers = [call.result(60) for call in calls]
    assert len(answers) == 2000


def test_who_asks_nothing_for_long_is_disconnected_and_connects_again_unnoticed(monkeypatch):
    monkeypatch.setattr(serve, "_IDLE_MS", 200)
    states = []
    with serving(warm=False) as host, grpc.insecure_channel(host.address, OWN) as channel:
        channel.subscribe(states.append)
        stub = CatalogServiceStub(channel)
        for _ in range(2):
            stub.GetServerInfo(GetServerInfoRequest(), timeout=20)
            wait_until(lambda: states[-1:] == [grpc.ChannelConnectivity.IDLE], "it stays connected")
            states.clear()


def test_one_connection_sends_so_many_calls_at_once_and_no_more(monkeypatch):
    monkeypatch.setattr(serve, "_MOST_AT_ONCE", 2)
    options = {**ENDLESS, "timeout": 60}
    with serving(max_concurrent_matches=4) as host, Client(host.address, retries=0) as client:
        running = [client.events(scene(8), scene(8, 1), **options) for _ in range(2)]
        for events in running:
            next(events)
        with pytest.raises(DeadlineExceededError):
            client.server_info(timeout=0.5)
        running[0].close()
        client.server_info(timeout=60)
        running[1].close()


def test_a_match_without_a_time_budget_gets_the_servers_default():
    with serving(default_time_budget=0.3) as host, Client(host.address) as client:
        match = client.match(scene(20), scene(20, 1), **ENDLESS)
    assert match.accepted.time_budget.ToTimedelta().total_seconds() == 0.3
