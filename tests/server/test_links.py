"""Callers that freeze or vanish, and callers that all come at once."""

import signal
import subprocess
import sys
import time

import pytest

from sketchmatch.server import serve
from sketchmatch_client import Client, ServerBusyError
from sketchmatch_proto.v1.catalog_service_pb2 import GetServerInfoRequest
from sketchmatch_proto.v1.catalog_service_pb2_grpc import CatalogServiceStub
from tests.pace import within
from tests.server.harness import ENDLESS, _loop, scene, serving, when_there_is_room

ONE_THAT_WAITS = """
import sys
from sketchmatch_client import Client
from tests.server.harness import ENDLESS, scene
with Client(sys.argv[1]) as client:
    for event in client.events(scene(8), scene(8, 1), **ENDLESS):
        print(event.WhichOneof("event"), flush=True)
"""


def test_a_caller_that_is_frozen_gives_its_place_back(monkeypatch):
    monkeypatch.setattr(serve, "_PING_MS", 400)
    with serving(max_concurrent_matches=1, max_time_budget=600.0) as host:
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


def test_of_thousands_of_calls_at_once_none_is_dropped():
    count = 1500
    with serving(warm=False) as host, Client(host.address) as client:
        stub = CatalogServiceStub(client._channel)
        # While it is busy otherwise they pile up inside gRPC.
        _loop().call_soon_threadsafe(time.sleep, 1.5)
        calls = [stub.GetServerInfo.future(GetServerInfoRequest()) for _ in range(count)]
        answers = [call.result(60) for call in calls]
    assert len(answers) == count


def test_a_match_without_a_time_budget_gets_the_servers_default():
    with serving(default_time_budget=0.3) as host, Client(host.address) as client:
        match = client.match(scene(20), scene(20, 1), **ENDLESS)
    assert match.accepted.time_budget.ToTimedelta().total_seconds() == 0.3
