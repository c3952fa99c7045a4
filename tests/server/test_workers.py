"""Worker processes are busy, lost and killed, and callers notice as little as they must."""

import asyncio
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
from grpc import insecure_channel
from grpc_health.v1 import health_pb2, health_pb2_grpc

from sketchmatch.app import workers
from sketchmatch.app.setup import RequestLimits, Setup
from sketchmatch.errors import WorkerLostError
from sketchmatch.pipeline.engine import Engine
from sketchmatch.registry import default_registry
from sketchmatch_client import (
    AsyncClient,
    Client,
    InvalidRequestError,
    ServerBusyError,
    ServerUnavailableError,
    sources,
)
from sketchmatch_proto.v1.match_pb2 import OUTCOME_SERVER_STOPPING
from tests.pace import wait_until, within
from tests.processes import children_of, is_alive, server
from tests.server.harness import ENDLESS, hosting, in_loop, scene, shapes


def limits(**given):
    return RequestLimits(**{"max_time_budget": 30.0, **given})


@contextmanager
def working(kept=2, **given):
    """Run a server with workers, and yield its address."""
    with hosting(Setup(Engine(default_registry()), limits(**given)), workers=kept) as host:
        yield host.address


@pytest.fixture(scope="module")
def address():
    with working() as found:
        yield found


def searching(client, **options):
    """Begin a search that goes on until it is stopped, and wait until it has found something."""
    events = client.events(scene(20), scene(20, 1), **ENDLESS, **options)
    while not next(events).progress.HasField("confidence"):
        pass
    return events


def busy_process(server_pid) -> int:
    """Return the process below a server that computes most just now."""

    def spent(pid):
        text = Path(f"/proc/{pid}/stat").read_text(encoding="ascii")
        return sum(map(int, text.rpartition(")")[2].split()[11:13]))

    before = {pid: spent(pid) for pid in children_of(server_pid)}
    time.sleep(0.5)
    return max(before, key=lambda pid: spent(pid) - before[pid] if is_alive(pid) else 0)


def test_requests_are_answered_in_processes_as_they_are_in_this_one(address):
    polygons = shapes(6)
    with Client(address) as client, Client(address) as other:
        first, again = (
            each.match(sources.polygons(polygons), sources.polygons(polygons[::-1]), seed=5)
            for each in (client, other)
        )
        assert first.object_map == again.object_map == {k: 5 - k for k in range(6)}
        assert first.accepted.match_id == first.result.match_id != again.result.match_id
        assert len(client.segment(scene(4)).scene.objects) == 4
        with pytest.raises(InvalidRequestError, match=r"pipeline\.searcher\.name"):
            client.match(scene(4), scene(4), searcher="nobody")


def test_bytes_that_are_no_request_are_an_invalid_argument(address):
    with insecure_channel(address) as channel:
        call = channel.unary_stream("/sketchmatch.v1.MatchService/Match")
        with pytest.raises(Exception, match="cannot be decoded") as no:
            list(call(b"\xff\xff\xff", timeout=30))
    assert no.value.code().name == "INVALID_ARGUMENT"


@pytest.mark.slow
def test_a_match_whose_worker_is_killed_may_be_sent_again_and_no_other_notices():
    with server("--workers", "2") as running, Client(running.address, retries=0) as client:
        pid = running.process.pid
        small = [client.match(scene(5), scene(5)).object_map for _ in range(3)]
        events = searching(client)
        worker = busy_process(pid)
        with within(1.0):
            os.kill(worker, signal.SIGKILL)
            with pytest.raises(
                ServerUnavailableError, match="the worker ended its process"
            ) as lost:
                list(events)
        assert lost.value.reason == "WORKER_LOST"
        assert client.match(scene(5), scene(5)).object_map == small[0]
        assert worker not in children_of(pid)
        wait_until(
            lambda: any("ended unexpectedly (signal 9)" in line for line in running.said),
            "the log does not say how the worker ended",
        )


@pytest.mark.slow
def test_workers_that_are_killed_while_they_wait_are_replaced_without_a_word():
    with server("--workers", "2") as running, Client(running.address) as client:
        pid = running.process.pid
        forking, *_ = children_of(pid)
        for worker in children_of(pid):
            if worker != forking:
                os.kill(worker, signal.SIGKILL)
        for _ in range(3):
            assert len(client.match(scene(5), scene(5)).object_map) == 5


def test_a_task_that_its_worker_had_not_begun_to_tell_of_is_done_by_another():
    given, original = [], workers._Worker.begin

    def begin(worker, task):
        given.append((task.id, worker))
        if len(given) == 1:
            worker._process.kill()
            worker._process.join()
        original(worker, task)

    with working() as address, Client(address) as client, pytest.MonkeyPatch.context() as patch:
        patch.setattr(workers._Worker, "begin", begin)
        assert len(client.match(scene(5), scene(5)).object_map) == 5
    (first, lost), (again, other) = given
    assert first == again
    assert lost is not other


@pytest.mark.slow
def test_what_is_stopped_and_does_not_heed_it_loses_its_process_and_frees_its_place():
    full = {"max_concurrent_matches": 1, "max_waiting": 0}
    with working(1, **full) as address, Client(address) as client:
        for _ in range(3):
            searching(client).close()
            wait_until(lambda: tries(client), "the place is never given back")


def tries(client):
    try:
        return client.match(scene(4), scene(4)).object_map
    except ServerBusyError:
        return None


def test_small_matches_go_on_beside_more_large_ones_than_there_are_processors(address):
    with Client(address) as client, ExitStack() as stack:
        for _ in range(4):
            stack.callback(searching(client).close)
        for _ in range(5):
            assert len(client.match(scene(8), scene(8)).object_map) == 8
        wait_until(lambda: nice_processes() == 4, "large matches do not give way to small ones")


def nice_processes() -> int:
    mine = os.getpriority(os.PRIO_PROCESS, 0)
    return sum(nice_of(pid) > mine for pid in children_of(os.getpid()))


def nice_of(pid):
    with suppress(ProcessLookupError):
        return os.getpriority(os.PRIO_PROCESS, pid)
    return -20


@pytest.mark.slow
def test_a_polite_client_gets_its_turn_beside_a_flood():
    full = {"max_concurrent_matches": 2, "max_waiting": 100}
    counts, stop = {"flood": 0, "polite": 0}, threading.Event()

    def flood(address):
        with Client(address, retries=0, options=(("grpc.use_local_subchannel_pool", 1),)) as client:
            while not stop.is_set():
                client.match(scene(5), scene(5))
                counts["flood"] += 1

    with working(2, **full) as address, ThreadPoolExecutor(12) as pool:
        flooding = [pool.submit(flood, address) for _ in range(12)]
        try:
            wait_until(lambda: counts["flood"] > 20, "the flood does not flow")
            with Client(address, options=(("grpc.use_local_subchannel_pool", 1),)) as polite:
                before = counts["flood"]
                for _ in range(5):
                    assert len(polite.match(scene(5), scene(5)).object_map) == 5
                beside = counts["flood"] - before
        finally:
            stop.set()
        for each in flooding:
            each.result(60)
    assert beside <= 5 * 12 + 2 * 12, "each of its requests waits for one turn of the others"


def test_what_costs_nothing_is_answered_while_all_places_and_the_queue_are_full():
    full = {"max_concurrent_matches": 2, "max_waiting": 2}
    with (
        working(2, **full) as address,
        Client(address, retries=0) as client,
        ExitStack() as stack,
    ):
        for _ in range(2):
            stack.callback(searching(client).close)
        waiting = [client.events(scene(20), scene(20, 1), **ENDLESS) for _ in range(2)]
        pool = stack.enter_context(ThreadPoolExecutor(2))
        for events in waiting:
            stack.callback(events.close)
            pool.submit(next, events, None)
        with insecure_channel(address) as channel, within(10.0):
            wait_until(lambda: refused(client), "there is always room")
            for _ in range(10):
                with pytest.raises(
                    ServerBusyError, match="2 requests are running and 2 are waiting"
                ) as busy:
                    client.match(scene(3), scene(3))
                assert busy.value.retry_after >= 1.0
                assert client.algorithms().algorithms
                assert client.server_info().limits.max_waiting == 2
                check = health_pb2_grpc.HealthStub(channel).Check(health_pb2.HealthCheckRequest())
                assert check.status == health_pb2.HealthCheckResponse.SERVING


def refused(client):
    try:
        client.match(scene(3), scene(3), timeout=0.5)
    except ServerBusyError:
        return True
    except Exception:
        return False
    return False


@pytest.mark.slow
def test_nothing_is_lost_or_mixed_up_among_hundreds_of_requests(address):
    """Each request has an answer of its own, and many callers ask at once."""

    async def ask(client, k):
        order = np.random.default_rng(k).permutation(4)
        sketch = shapes(4, seed=k % 7)
        sent = client.match(
            sources.polygons(sketch),
            sources.polygons([sketch[i] for i in order], [f"{k}-{i}" for i in order]),
            searcher="auto",
            judge="confidence",
            alternatives=0,
            seed=k,
        )
        found = await sent
        assert found.result.seed == k
        assert {line.sketch_object: line.map_label for line in found.result.object_matches} == {
            i: f"{k}-{i}" for i in range(4)
        }
        return found.result.match_id

    async def asked():
        names = []
        async with AsyncClient(address) as client:
            for first in range(0, 300, 30):
                names += await asyncio.gather(*(ask(client, first + k) for k in range(30)))
        return names

    assert len(set(in_loop(asked()).result(300))) == 300


@pytest.mark.slow
def test_a_process_group_that_is_told_to_end_comes_to_an_end_as_its_server_does():
    said = ("--grace", "8", "--workers", "2")
    with server(*said) as running, Client(running.address, retries=0) as client:
        events = searching(client)
        for pid in (*children_of(running.process.pid), running.process.pid):
            os.kill(pid, signal.SIGTERM)
        assert list(events)[-1].result.outcome == OUTCOME_SERVER_STOPPING
        assert running.end() == 0


@pytest.mark.slow
def test_no_worker_outlives_a_server_that_is_killed():
    with server("--workers", "2") as running, Client(running.address, retries=0) as client:
        events = searching(client)
        processes = children_of(running.process.pid)
        assert len(processes) >= 3
        running.process.kill()
        running.process.wait(10)
        wait_until(lambda: not any(map(is_alive, processes)), "a process outlives its server")
        with pytest.raises(ServerUnavailableError):
            list(events)


CRASHING = """
import asyncio
from sketchmatch.app.application import Application
from sketchmatch.app.setup import Setup
from sketchmatch.pipeline.engine import Engine
from sketchmatch.registry import default_registry

async def main():
    await Application(Setup(Engine(default_registry())), workers=2).start(print)
    raise SystemExit("somebody else's fault")

asyncio.run(main())
"""


@pytest.mark.slow
def test_a_process_that_never_comes_to_close_its_workers_ends_all_the_same():
    ended = subprocess.run(
        [sys.executable, "-c", CRASHING], capture_output=True, text=True, timeout=120, check=False
    )
    assert (ended.returncode, ended.stderr) == (1, "somebody else's fault\n")


def test_workers_that_are_asked_for_while_others_are_closed_are_none():
    setup = Setup(Engine(default_registry()), limits())

    async def closed():
        those = workers.Workers(1, lambda *_: None, lambda: None)
        await those.close()
        with pytest.raises(WorkerLostError):
            await those.start(setup)
        await asyncio.wait_for(those.close(), 60)

    in_loop(closed()).result(120)
