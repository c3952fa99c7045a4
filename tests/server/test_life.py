import os
import signal
import socket
import time

import pytest
from grpc import insecure_channel
from grpc_health.v1 import health_pb2, health_pb2_grpc
from grpc_reflection.v1alpha.proto_reflection_descriptor_database import (
    ProtoReflectionDescriptorDatabase,
)

import sketchmatch
from sketchmatch.pipeline.selection import Choice, Defaults
from sketchmatch.pipeline.warmup import warm_up
from sketchmatch.registry import default_registry
from sketchmatch.server import serve
from sketchmatch_client import Client, InvalidRequestError, ServerUnavailableError
from sketchmatch_client.errors import CallCancelledError
from sketchmatch_proto.v1 import catalog_service_pb2
from sketchmatch_proto.v1.match_pb2 import OUTCOME_SERVER_STOPPING
from tests.pace import wait_until, within
from tests.processes import server
from tests.processes import sketchmatch as run
from tests.server.harness import ENDLESS, scene, serving
from tests.server.probes import Exploding, SlowToWarm, TellsWhenWarm

SERVICES = [f"sketchmatch.v1.{name}Service" for name in ("Match", "Scene", "Catalog")]


def health(address: str, service: str = "") -> str:
    with insecure_channel(address) as channel:
        request = health_pb2.HealthCheckRequest(service=service)
        status = health_pb2_grpc.HealthStub(channel).Check(request, timeout=60).status
    return health_pb2.HealthCheckResponse.ServingStatus.Name(status)


SLOW_DEFAULT = Defaults({"searcher": Choice("slow-to-warm")})


def test_health_is_not_serving_until_the_default_kernels_are_warm():
    warm_up(default_registry())  # on a new machine the others take a minute
    SlowToWarm.may_finish.clear()
    with serving(SlowToWarm, warm=False, defaults=SLOW_DEFAULT) as host:
        assert health(host.address) == "NOT_SERVING"
        with Client(host.address) as client, pytest.raises(ServerUnavailableError, match="wait"):
            client.wait_until_serving(0.2)
        SlowToWarm.may_finish.set()
        with Client(host.address) as client:
            client.wait_until_serving(5)
        assert [health(host.address, name) for name in ("", *SERVICES)] == ["SERVING"] * 4


def test_an_algorithm_is_ready_once_its_kernels_are_and_not_before(monkeypatch):
    monkeypatch.setattr(serve, "_QUIET", 0.0)
    warm_up(default_registry())
    SlowToWarm.may_finish.clear()
    with serving(SlowToWarm, Exploding) as host, Client(host.address) as client:
        assert client.is_serving("searcher/align")
        assert client.is_serving("judge/posterior")
        assert not client.is_serving("searcher/slow-to-warm")
        SlowToWarm.may_finish.set()
        wait_until(lambda: client.is_serving("searcher/slow-to-warm"), "it is never ready")
        wait_until(lambda: client.is_serving("searcher/nn"), "the others are never ready")
        assert not client.is_serving("searcher/exploding")
        with pytest.raises(InvalidRequestError, match=r"^name is 'searcher/esm', which"):
            client.is_serving("searcher/esm")


def test_a_server_that_is_stopped_while_it_warms_up_stops():
    SlowToWarm.may_finish.clear()
    with serving(SlowToWarm, warm=False, defaults=SLOW_DEFAULT) as host:
        host.stop()
        time.sleep(0.1)
        SlowToWarm.may_finish.set()
    assert "serving" not in host.said
    assert host.said[-1] == "stopped"


@pytest.fixture
def at_once(monkeypatch):
    """Warm up the other algorithms as soon as the server serves."""
    monkeypatch.setattr(serve, "_QUIET", 0.0)


@pytest.mark.usefixtures("at_once")
def test_it_serves_while_the_other_kernels_warm_up_and_stops_then_too():
    SlowToWarm.may_finish.clear()
    with serving(SlowToWarm) as host, Client(host.address) as client:
        assert client.match(scene(3), scene(3)).object_map == {0: 0, 1: 1, 2: 2}
        host.stop()
        time.sleep(0.1)
        SlowToWarm.may_finish.set()
    assert host.said[-1] == "stopped"


@pytest.mark.slow
def test_the_other_kernels_wait_until_no_request_is_under_way(monkeypatch):
    monkeypatch.setattr(serve, "_QUIET", 0.7)
    TellsWhenWarm.warm.clear()
    with serving(TellsWhenWarm) as host, Client(host.address) as client:
        events = client.events(scene(8), scene(8, 1), **ENDLESS, time_budget=2.0)
        next(events)
        assert not TellsWhenWarm.warm.wait(1.0)
        assert any(event.HasField("result") for event in events)
        assert TellsWhenWarm.warm.wait(60)


@pytest.mark.usefixtures("at_once")
def test_an_algorithm_that_cannot_warm_up_does_not_keep_the_others_from_serving(caplog):
    with serving(Exploding) as host, Client(host.address) as client:
        told = "searcher exploding of acme-plugins 1.2 failed to warm up"
        wait_until(lambda: told in caplog.text, "nobody was told")
        assert client.match(scene(3), scene(3)).object_map == {0: 0, 1: 1, 2: 2}


def test_reflection_lists_the_services_and_describes_them(address):
    with insecure_channel(address) as channel:
        database = ProtoReflectionDescriptorDatabase(channel)
        listed = database.get_services()
        file = database.FindFileContainingSymbol("sketchmatch.v1.MatchService")
        # As the protocol has it, and as ghz asks.
        by_method = database.FindFileContainingSymbol("sketchmatch.v1.MatchService.CancelMatch")
        for unknown in ("sketchmatch.v1.Unheard.Match", "Unheard", ""):
            with pytest.raises(KeyError):
                database.FindFileContainingSymbol(unknown)
    assert {*SERVICES, "grpc.health.v1.Health"} <= set(listed)
    assert [service.name for service in file.service] == ["MatchService"]
    assert by_method == file


def test_the_catalogue_tells_what_there_is_and_what_is_the_default(address):
    with Client(address) as client:
        catalogue = client.algorithms()
    kind = catalog_service_pb2.AlgorithmKind.Name
    defaults = {(kind(a.kind), a.name) for a in catalogue.algorithms if a.is_default}
    assert defaults >= {
        ("ALGORITHM_KIND_HISTOGRAM", "constant"),
        ("ALGORITHM_KIND_SIMILARITY", "cross-correlation"),
        ("ALGORITHM_KIND_SEARCHER", "align"),
        ("ALGORITHM_KIND_JUDGE", "posterior"),
        ("ALGORITHM_KIND_SEGMENTER", "strokes"),
    }
    easm = next(a for a in catalogue.algorithms if a.name == "easm")
    patience = easm.parameters_schema["properties"]["patience"]
    assert (patience["default"], patience["minimum"]) == (400, 1)
    assert patience["description"]
    assert [plugin.distribution for plugin in catalogue.plugins] == ["sketchmatch"]


def test_the_server_tells_its_version_and_limits():
    with (
        serving(max_time_budget=2.5, max_concurrent_matches=3) as host,
        Client(host.address) as client,
    ):
        info = client.server_info()
    assert info.version == sketchmatch.__version__
    assert info.api_version == "sketchmatch.v1"
    assert info.limits.max_concurrent_matches == 3
    assert info.limits.max_request_bytes == 64 * 1024**2
    assert info.limits.max_time_budget.ToTimedelta().total_seconds() == 2.5


@pytest.mark.parametrize("named", ["{folder}/notify", "@sketchmatch-{number}"])
def test_systemd_is_told_when_the_server_serves_and_when_it_stops(tmp_path, monkeypatch, named):
    address = named.format(folder=tmp_path, number=os.getpid())
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link:
        link.bind(address.replace("@", "\0"))
        link.settimeout(100)
        monkeypatch.setenv("NOTIFY_SOCKET", address)
        with serving(warm=False) as host:
            assert link.recv(100) == b"READY=1"
            assert "serving" in host.said
        assert link.recv(100) == b"STOPPING=1"


def test_a_systemd_that_does_not_listen_stops_nobody(monkeypatch, tmp_path):
    for address in (str(tmp_path / "away"), "nonsense", ""):
        monkeypatch.setenv("NOTIFY_SOCKET", address)
        with serving() as host:
            assert "serving" in host.said


@pytest.mark.slow
def test_sigterm_ends_an_idle_server_at_once_with_exit_code_0():
    with server() as running, within(2.0):
        running.process.send_signal(signal.SIGTERM)
        assert running.end() == 0
    assert running.said[-1] == "sketchmatch: stopped"


def test_sigterm_lets_a_running_match_end_within_the_grace():
    with server("--grace", "10") as running, Client(running.address) as client:
        events = client.events(scene(20), scene(20, 1), **ENDLESS, time_budget=1.0)
        while not next(events).progress.HasField("confidence"):
            pass
        with within(3.0):
            running.process.send_signal(signal.SIGTERM)
            assert list(events)[-1].WhichOneof("event") == "result"
            assert running.end() == 0


@pytest.mark.slow
@pytest.mark.parametrize("workers", ["2", "0"])
def test_sigterm_ends_matches_with_their_best_so_far_before_the_grace_ends(workers):
    said = ("--grace", "8", "--workers", workers)
    with server(*said) as running, Client(running.address, retries=0) as client:
        searches = [client.events(scene(8), scene(8, 1), **ENDLESS) for _ in range(2)]
        for events in searches:
            while not next(events).progress.HasField("confidence"):
                pass
        with within(11.0) as watch:
            running.process.send_signal(signal.SIGTERM)
            for events in searches:
                result = list(events)[-1].result
                assert result.outcome == OUTCOME_SERVER_STOPPING
                assert result.object_matches
            assert running.end() == 0
        assert watch.seconds > 1.9
    assert not any("Traceback" in line for line in running.said)


@pytest.mark.slow
def test_sigterm_with_no_grace_at_all_ends_matches_at_once():
    with server("--grace", "0") as running, Client(running.address, retries=0) as client:
        events = client.events(scene(20), scene(20, 1), **ENDLESS)
        while not next(events).progress.HasField("confidence"):
            pass
        with within(3.0):
            running.process.send_signal(signal.SIGTERM)
            with pytest.raises((ServerUnavailableError, CallCancelledError)):
                list(events)
            assert running.end() == 0
    assert not any("Traceback" in line for line in running.said)


@pytest.mark.slow
def test_a_second_server_on_the_same_port_is_refused_in_one_line(address):
    second = run("serve", "--address", address)
    assert second.returncode == 2
    assert second.stdout == ""
    (line,) = second.stderr.splitlines()
    assert line == (
        f"sketchmatch: address '{address}' cannot be listened on; "
        "choose a free port, as in 127.0.0.1:50051"
    )
