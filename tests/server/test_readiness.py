"""Which names health knows, and which of them are ready."""

import asyncio

import grpc
import pytest
from grpc_health.v1 import health_pb2, health_pb2_grpc

from sketchmatch.app.setup import Isolation, Setup
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.selection import UNCONFIGURED
from sketchmatch.registry import default_registry
from sketchmatch.server import readiness, serve
from sketchmatch.server.readiness import Readiness
from sketchmatch_client import Client, InvalidRequestError
from tests.pace import wait_until
from tests.server.harness import hosting, in_loop, registry_with, serving, serving_setup
from tests.server.probes import SlowToWarm

ALGORITHMS = {f"{item.kind}/{item.name}": item for item in default_registry().algorithms}
EASM, ALIGN, NN = (ALGORITHMS[f"searcher/{name}"] for name in ("easm", "align", "nn"))


async def told(readiness, *names):
    await asyncio.sleep(0.01)  # what another thread said is on its way
    return [
        health_pb2.HealthCheckResponse.ServingStatus.Name(
            (
                await readiness.servicer.Check(
                    health_pb2.HealthCheckRequest(service=name), context=None
                )
            ).status
        )
        for name in names
    ]


def test_what_a_new_configuration_keeps_stays_ready_and_what_it_drops_is_unknown():
    async def life():
        readiness = Readiness(["a.Service"])
        await readiness.know([EASM, ALIGN])
        assert await told(readiness, "", "searcher/easm") == ["NOT_SERVING"] * 2
        readiness.ready(EASM)
        readiness.ready(ALIGN)
        assert await told(readiness, "", "searcher/easm") == ["NOT_SERVING", "SERVING"]
        await readiness.serve()
        assert await told(readiness, "", "a.Service") == ["SERVING"] * 2
        await readiness.know([EASM, NN])
        names = ("", "searcher/easm", "searcher/nn", "searcher/align")
        states = ["SERVING", "SERVING", "NOT_SERVING", "SERVICE_UNKNOWN"]
        assert await told(readiness, *names) == states
        readiness.ready(ALIGN)  # of which nobody knows any longer
        assert await told(readiness, "searcher/align") == ["SERVICE_UNKNOWN"]
        await readiness.know([EASM, NN, ALIGN])
        assert await told(readiness, "searcher/align") == ["SERVING"]

    asyncio.run(life())


def test_after_a_reload_what_is_new_gets_ready_too(monkeypatch):
    monkeypatch.setattr(serve, "_QUIET", 0.0)
    actions, registries = {}, [default_registry(), registry_with(SlowToWarm)]
    monkeypatch.setattr(serve, "_on_signals", actions.update)
    SlowToWarm.may_finish.set()

    def load():
        return Setup(Engine(registries.pop(0), UNCONFIGURED), isolation=Isolation(frozenset("*")))

    async def reload():
        actions["SIGHUP"]()

    with hosting(load) as host, Client(host.address) as client:
        with pytest.raises(InvalidRequestError):
            client.is_serving("searcher/slow-to-warm")
        in_loop(reload()).result()
        wait_until(lambda: "the configuration is reloaded" in host.said, "it is not reloaded")
        wait_until(lambda: client.is_serving("searcher/slow-to-warm"), "it is never ready")
        assert client.is_serving("searcher/align")


@pytest.mark.parametrize("size", [1 << 20, 1 << 26])
def test_a_reload_changes_limits_but_that_of_the_size_of_requests(monkeypatch, size):
    actions, former = {}, 2 << 20
    monkeypatch.setattr(serve, "_on_signals", actions.update)
    setups = [
        serving_setup(max_request_bytes=former, max_waiting=5),
        serving_setup(max_request_bytes=size, max_waiting=6),
    ]

    async def reload():
        actions["SIGHUP"]()

    with hosting(lambda: setups.pop(0), warm=False) as host, Client(host.address) as client:
        in_loop(reload()).result()
        wait_until(lambda: "the configuration is reloaded" in host.said, "it is not reloaded")
        limits = client.server_info().limits
        assert (limits.max_request_bytes, limits.max_waiting) == (former, 6)
        assert (
            "server.max_request_mib does not change before the server is started again" in host.said
        )


def test_no_more_streams_watch_health_than_probes_need(monkeypatch):
    monkeypatch.setattr(readiness, "MOST_WATCHERS", 2)
    with serving(warm=False) as host, grpc.insecure_channel(host.address) as channel:
        stub = health_pb2_grpc.HealthStub(channel)
        request = health_pb2.HealthCheckRequest()
        watching = [stub.Watch(request) for _ in range(2)]
        assert all(next(stream).status for stream in watching)
        with pytest.raises(grpc.RpcError) as refused:
            next(stub.Watch(request))
        assert refused.value.code() is grpc.StatusCode.RESOURCE_EXHAUSTED
        assert "use Check" in refused.value.details()
        watching[0].cancel()

        def again():
            try:
                return next(stub.Watch(request)).status
            except grpc.RpcError:
                return 0

        wait_until(again, "a place is never given back")
        assert stub.Check(request)


def test_names_are_listed_to_nobody_and_no_stranger_fills_the_log_by_asking(caplog):
    with serving(warm=False) as host, grpc.insecure_channel(host.address) as channel:
        # As newer clients ask, whatever this one has.
        asking = channel.unary_unary("/grpc.health.v1.Health/List", bytes, bytes)
        with pytest.raises(grpc.RpcError) as refused:
            asking(b"")
    assert refused.value.code() is grpc.StatusCode.UNIMPLEMENTED
    assert not [each for each in caplog.records if "Health" in each.getMessage()]
