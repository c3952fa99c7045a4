"""Server, workers and clients are killed at any moment, and what readers see is one sound stream.

A recorded history of requests is checked against a model of a match's life: ``_check_history``.
"""

import asyncio
import os
import random
import signal
import socket
import subprocess
import sys
import threading
import time
import uuid
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import grpc
import pytest

from sketchmatch_client import AsyncClient, Client, match_request
from sketchmatch_client.errors import SketchmatchError
from sketchmatch_proto.v1.match_service_pb2 import (
    MATCH_STATE_CANCELLED,
    MATCH_STATE_FAILED,
    MATCH_STATE_INTERRUPTED,
    MATCH_STATE_SUCCEEDED,
    GetMatchResponse,
    WatchMatchRequest,
)
from sketchmatch_proto.v1.match_service_pb2_grpc import MatchServiceStub
from tests.pace import wait_until
from tests.processes import Server, children_of
from tests.server.harness import ENDLESS, scene

pytestmark = pytest.mark.slow
ENDS = {
    MATCH_STATE_SUCCEEDED,
    MATCH_STATE_FAILED,
    MATCH_STATE_CANCELLED,
    MATCH_STATE_INTERRUPTED,
}


class Mortal:
    """A server that is killed and started anew at the same port, with the same store."""

    def __init__(self, store, *arguments):
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.address = f"127.0.0.1:{probe.getsockname()[1]}"
        self._arguments = ("--address", self.address, "--store", str(store), *arguments)
        self.start()

    def start(self):
        self.server = Server(*self._arguments)
        self.server.wait_for("(serving)")

    def kill(self):
        self.server.process.kill()
        self.server.end()

    def stop(self):
        if self.server.process.poll() is None:
            self.server.process.terminate()
        self.server.end()


@contextmanager
def mortal(store, *arguments):
    server = Mortal(store, *arguments)
    try:
        yield server
    finally:
        server.stop()


def shown(event):
    """Return what an event says that is the same each time the match is done."""
    if event.HasField("result"):
        result = event.result
        return "result", [(m.sketch_object, m.map_object) for m in result.object_matches]
    if event.HasField("scenes"):
        return "scenes", event.scenes.SerializeToString(deterministic=True)
    return event.WhichOneof("event"), None


def told(events):
    return [shown(event) for event in events if not event.HasField("progress")]


SEARCH = {
    "searcher": "easm",
    "params": {"searcher": {"patience": 10_000_000, "generations": 100}},
}
PAIR = (scene(8, 0), scene(8, 1))


def test_a_server_is_killed_at_each_event_and_its_reader_sees_the_uncut_stream(tmp_path):
    with mortal(tmp_path, "--workers", "1") as server, Client(server.address) as client:
        uncut = list(client.events(*PAIR, **SEARCH))
        for kind in ("accepted", "scenes", "progress", "result"):
            seen, starting = [], None
            for event in client.events(*PAIR, **SEARCH):
                seen.append(event)
                if starting is None and event.HasField(kind):
                    server.kill()
                    starting = threading.Thread(target=server.start)
                    starting.start()
            assert starting is not None
            starting.join()
            assert told(seen) == told(uncut)
            known = [e.progress.confidence for e in seen if e.progress.HasField("confidence")]
            assert known == sorted(known)
        states = {match.match_id: match.state for match in client.matches()}
        # Of a result that was told in its last moment a killed server may know nothing, nor of the
        # match, if that was short: what is kept is written a moment later.
        assert set(states.values()) <= {MATCH_STATE_SUCCEEDED, MATCH_STATE_INTERRUPTED}
        assert len(states) in (4, 5)


def test_who_watches_a_match_of_a_server_that_was_killed_is_told_to_send_it_again(tmp_path):
    request = match_request(scene(8, 0), scene(8, 1), **ENDLESS)
    request.request_id = uuid.uuid4().hex
    with mortal(tmp_path) as server, grpc.insecure_channel(server.address) as channel:
        stub = MatchServiceStub(channel)
        call = stub.Match(request)
        name = next(call).accepted.match_id
        last = [next(call) for _ in range(5)][-1].number
        time.sleep(0.3)
        server.kill()
        server.start()
        watch = stub.WatchMatch(WatchMatchRequest(match_id=name, after=last), wait_for_ready=True)
        with pytest.raises(grpc.RpcError) as refused:
            list(watch)
        assert refused.value.code() is grpc.StatusCode.UNAVAILABLE
        again = stub.Match(request)
        event = next(again)
        assert event.accepted.match_id == name
        assert event.number > last
        again.cancel()


def test_a_worker_is_killed_and_its_match_is_done_again(tmp_path):
    with mortal(tmp_path) as server, Client(server.address) as client:
        uncut = list(client.events(*PAIR, **SEARCH))
        workers = _workers(server)
        seen = []
        for event in client.events(*PAIR, **SEARCH):
            seen.append(event)
            if workers and event.progress.HasField("confidence"):
                for pid in workers:
                    with suppress(ProcessLookupError):
                        os.kill(pid, signal.SIGKILL)
                workers = []
        assert told(seen) == told(uncut)


def _workers(server):
    """Return the processes that a server's work is done in."""
    found = children_of(server.server.process.pid)
    return [pid for pid in found if not children_of(pid) and "tracker" not in _command(pid)]


def _command(pid):
    try:
        return Path(f"/proc/{pid}/cmdline").read_text(encoding="utf-8")
    except OSError:
        return ""


@pytest.mark.parametrize("keep_running", [False, True])
def test_a_client_is_killed_and_its_match_stops_unless_it_is_to_keep_running(
    tmp_path, keep_running
):
    code = (
        "from tests.server.harness import ENDLESS, scene\n"
        "from sketchmatch_client import Client\n"
        "import sys\n"
        f"call = Client(sys.argv[1]).events(scene(8, 0), scene(8, 1), **ENDLESS, "
        f"keep_running={keep_running}, time_budget=30)\n"
        "for event in call: print(event.number, event.accepted.match_id, flush=True)\n"
    )
    with mortal(tmp_path) as server, Client(server.address) as client:
        process = subprocess.Popen(
            [sys.executable, "-c", code, server.address], stdout=subprocess.PIPE, text=True
        )
        with process.stdout as lines:
            name = lines.readline().split()[1]
            for _ in range(3):
                lines.readline()
            process.kill()
            process.wait()
        if keep_running:
            time.sleep(1.0)
            assert not client.get_match(name).match.HasField("ended_at")
            client.cancel_match(name)
        wait_until(lambda: client.get_match(name).match.HasField("ended_at"), "it never ends")
        expected = MATCH_STATE_CANCELLED if keep_running else MATCH_STATE_INTERRUPTED
        assert client.get_match(name).match.state == expected


@dataclass
class Request:
    """What one request of a history was, and what its reader saw.

    Attributes
    ----------
    name
        Its request_id.
    kind
        Which of a few requests it is, so that those of one name are the same.
    seen
        Its events, as the client gave them.
    error
        What it ended with, if with an error.
    """

    name: str
    kind: int
    seen: list = field(default_factory=list)
    error: SketchmatchError | None = None


def _check_history(requests: list[Request], found: dict[str, GetMatchResponse]) -> None:
    """Check what readers saw against a model of a match's life.

    Each stream tells accepted, scenes, progress and a result, in this order, each but progress
    once; ζ never falls. A request without an error has a result. All requests of one name are one
    match, which the server knows by that name and which has one end; all its results are the same.
    """
    by_name: dict[str, list[Request]] = {}
    for request in requests:
        by_name.setdefault(request.name, []).append(request)
        kinds = [event.WhichOneof("event") for event in request.seen]
        order = [kind for kind in kinds if kind != "progress"]
        assert order == ["accepted", "scenes", "result"][: len(order)], request
        assert ("result" in kinds) == (request.error is None), request
        assert "result" not in kinds[:-1], request
        confidences = [
            event.progress.confidence
            for event in request.seen
            if event.progress.HasField("confidence")
        ]
        assert confidences == sorted(confidences), request
    for name, same in by_name.items():
        names = {
            event.accepted.match_id for r in same for event in r.seen if event.HasField("accepted")
        }
        assert len(names) <= 1, (name, names)
        results = {repr(shown(event)) for r in same for event in r.seen if event.HasField("result")}
        assert len(results) <= 1, (name, results)
        for match_id in names:
            match = found[match_id].match
            assert match.request_id == name
            assert match.state in ENDS, (name, match)
            kept = [event.WhichOneof("event") for event in found[match_id].events]
            assert ("result" in kept) == (match.state == MATCH_STATE_SUCCEEDED), (name, match)
            numbers = [event.number for event in found[match_id].events]
            assert numbers == sorted(set(numbers)), (name, numbers)


def test_a_history_of_requests_with_cancels_kills_and_lost_links_is_that_of_the_model(tmp_path):
    chance = random.Random(19)
    pairs = [(scene(5 + k, k), scene(5 + k, k + 10)) for k in range(4)]
    requests: list[Request] = []
    over = asyncio.Event()

    async def ask(address, request):
        options = {"request_id": request.name, "seed": request.kind, **SEARCH}
        pair = pairs[request.kind % len(pairs)]
        leave = chance.choice([None, None, None, 1, 3, 8])
        cancel = chance.random() < 0.15
        async with AsyncClient(address, retries=10) as client:
            events = client.events(*pair, **options)
            try:
                async for event in events:
                    request.seen.append(event)
                    if cancel and event.HasField("scenes"):
                        await client.cancel_match(request.seen[0].accepted.match_id)
                    if len(request.seen) == leave and not event.HasField("result"):
                        request.error = SketchmatchError("left")
                        break
            except SketchmatchError as error:
                request.error = error
            finally:
                await events.aclose()

    async def callers(address):
        async def caller(number):
            for k in range(20):
                # Two callers ask for each match, at about the same time.
                request = Request(f"{number // 2}-{k}", k)
                requests.append(request)
                await ask(address, request)

        await asyncio.gather(*(caller(number) for number in range(10)))
        over.set()

    async def killer(server):
        for _ in range(3):
            await asyncio.sleep(4.0)
            if over.is_set():
                return
            await asyncio.to_thread(server.kill)
            await asyncio.to_thread(server.start)
            await asyncio.sleep(2.0)
            for pid in _workers(server):
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)

    async def run(server):
        await asyncio.gather(callers(server.address), killer(server))

    with mortal(tmp_path) as server:
        asyncio.run(run(server))
        with Client(server.address) as client:
            listed = list(client.matches())
            assert len({match.match_id for match in listed}) == len(listed)
            wait_until(
                lambda: all(match.HasField("ended_at") for match in client.matches()),
                "a match never ends, and keeps its place",
            )
            found = {match.match_id: client.get_match(match.match_id) for match in client.matches()}
            assert client.match(*pairs[0]).object_map  # places are free
    assert len(requests) == 200
    assert sum(1 for request in requests if request.error is None) > 50
    _check_history(requests, found)
