"""The life of a server: start, warm up, serve, drain, stop."""

from __future__ import annotations

import asyncio
import logging
import signal
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import Event
from typing import Any

import grpc
from grpc_health.v1 import health, health_pb2, health_pb2_grpc
from grpc_reflection.v1alpha import reflection

from sketchmatch.errors import InvalidInputError, Reason, SketchmatchError
from sketchmatch.pipeline.warmup import announcing_compilation, warm_up, warm_up_others
from sketchmatch.registry import Registry
from sketchmatch.server.child import Job, Method
from sketchmatch.server.isolation import Children, Watch
from sketchmatch.server.services import CatalogService, MatchService, SceneService, Workers
from sketchmatch.server.setup import Current, Setup
from sketchmatch_proto.v1 import (
    catalog_service_pb2,
    catalog_service_pb2_grpc,
    match_service_pb2,
    match_service_pb2_grpc,
    scene_service_pb2,
    scene_service_pb2_grpc,
)

__all__ = ["ServerSettings", "serve"]

_QUIET = 1.0
_LOOK = 0.05
_WARMING = 120.0

_log = logging.getLogger(__name__)
_SERVICES = (
    match_service_pb2.DESCRIPTOR.services_by_name["MatchService"].full_name,
    scene_service_pb2.DESCRIPTOR.services_by_name["SceneService"].full_name,
    catalog_service_pb2.DESCRIPTOR.services_by_name["CatalogService"].full_name,
)


@dataclass(frozen=True)
class ServerSettings:
    """How to serve; what cannot be exchanged while the server runs.

    Attributes
    ----------
    address
        Host and port to listen on; port 0 picks a free one.
    grace
        Seconds that running matches are given when the server is asked to stop.
    """

    address: str = "127.0.0.1:50051"
    grace: float = 5.0


async def serve(
    load: Callable[[], Setup],
    settings: ServerSettings,
    say: Callable[[str], None],
    stop: asyncio.Event | None = None,
) -> None:
    """Serve until SIGTERM, SIGINT, or ``stop`` is set.

    Parameters
    ----------
    load
        Returns what requests are answered with. It is called again, in a thread, at each SIGHUP;
        what it raises then is said, and the former setup stays. Requests under way end with
        theirs.
    settings
        How to serve.
    say
        Called with sentences for the person who started the server.
    stop
        Ends the server from within the process.

    Raises
    ------
    SketchmatchError
        If there is no setup to begin with.
    InvalidInputError
        If the address cannot be listened on.
    """
    current = Current(load())
    workers, children = Workers(current.setup.limits), Children()
    server = grpc.aio.server(
        options=[
            ("grpc.max_receive_message_length", current.setup.limits.transport_bytes),
            ("grpc.max_send_message_length", -1),
            # Clients ping every 30 s; by default the server would hang up on them.
            ("grpc.http2.min_ping_interval_without_data_ms", 20_000),
            # Otherwise a second server on the same port would silently take half of the calls.
            ("grpc.so_reuseport", 0),
        ]
    )
    checks = _add_services(server, current, workers, children)
    port = _listen(server, settings.address)
    await checks.set("", health_pb2.HealthCheckResponse.NOT_SERVING)
    await server.start()
    stopping, ended = stop or asyncio.Event(), Event()
    reloading = _Reloading(load, current, workers, say)
    _on_signals({"SIGTERM": stopping.set, "SIGINT": stopping.set, "SIGHUP": reloading.start})
    host = settings.address.rpartition(":")[0]
    say(f"listening on {host}:{port}")
    for problem in current.setup.registry.problems:
        say(problem)
    try:
        with announcing_compilation(say):
            warming = asyncio.to_thread(_warm_up, current.setup, stopping.is_set)
            await _first(asyncio.ensure_future(warming), stopping)
        if not stopping.is_set():
            for name in ("", *_SERVICES):
                await checks.set(name, health_pb2.HealthCheckResponse.SERVING)
            say("serving")
            wanted = _unless_quiet(workers, stopping)
            others = asyncio.to_thread(_warm_up_others, current.setup, children, wanted, ended)
            await _first(asyncio.ensure_future(others), stopping)
        await stopping.wait()
        say(f"stopping; running matches have {settings.grace:g} s to end")
    finally:
        ended.set()
        await checks.enter_graceful_shutdown()
        await server.stop(settings.grace)
        await workers.close()
        await asyncio.to_thread(children.close)
    say("stopped")


class _Reloading:
    """Exchanges the setup, one load at a time."""

    def __init__(
        self,
        load: Callable[[], Setup],
        current: Current,
        workers: Workers,
        say: Callable[[str], None],
    ) -> None:
        self._load = load
        self._current = current
        self._workers = workers
        self._say = say
        self._one_at_a_time = asyncio.Lock()
        self._tasks: set[asyncio.Task[None]] = set()

    def start(self) -> None:
        task = asyncio.create_task(self._reload())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _reload(self) -> None:
        async with self._one_at_a_time:
            try:
                setup = await asyncio.to_thread(self._load)
            except SketchmatchError as error:
                self._say(f"the configuration stays as it is: {error}")
                return
            self._current.setup = setup
            self._workers.change_limits(setup.limits)
            for problem in setup.registry.problems:
                self._say(problem)
            self._say("the configuration is reloaded")


def _warm_up(setup: Setup, unwanted: Callable[[], bool]) -> None:
    """Compile what the default pipeline needs in this process."""
    warm_up(_inside(setup), setup.defaults, unwanted)


def _warm_up_others(
    setup: Setup, children: Children, unwanted: Callable[[], bool], ended: Event
) -> None:
    """Compile the rest, strangers' algorithms in processes of their own."""
    warm_up_others(_inside(setup), setup.defaults, unwanted)
    strangers = setup.isolation.strangers(setup.registry.algorithms)
    job = Job(Method.WARM_UP, b"", setup.defaults, setup.limits, _WARMING)
    for distribution in sorted({item.distribution for item in strangers}):
        if unwanted():
            return
        watch = Watch(tuple(s for s in strangers if s.distribution == distribution), _WARMING)
        try:
            for _ in children.answer(job, watch, ended):
                pass
        except Exception:  # it will fail again, and be blamed, when a request asks for it
            _log.exception("the plugins of %s failed to warm up", distribution)


def _inside(setup: Setup) -> Registry:
    """Return the algorithms that run in this process."""
    strangers = setup.isolation.strangers(setup.registry.algorithms)
    return setup.registry.without(*(item.distribution for item in strangers))


def _add_services(
    server: grpc.aio.Server, current: Current, workers: Workers, children: Children
) -> health.aio.HealthServicer:
    match_service_pb2_grpc.add_MatchServiceServicer_to_server(
        MatchService(current, workers, children), server
    )
    scene_service_pb2_grpc.add_SceneServiceServicer_to_server(
        SceneService(current, workers, children), server
    )
    catalog_service_pb2_grpc.add_CatalogServiceServicer_to_server(CatalogService(current), server)
    checks = health.aio.HealthServicer()
    health_pb2_grpc.add_HealthServicer_to_server(checks, server)
    reflection.enable_server_reflection(
        (*_SERVICES, health.SERVICE_NAME, reflection.SERVICE_NAME), server
    )
    return checks


def _listen(server: grpc.aio.Server, address: str) -> int:
    try:
        port = server.add_insecure_port(address)
    except RuntimeError:
        port = 0
    if port == 0:
        raise InvalidInputError(
            Reason.INVALID_FIELD,
            "address",
            f"{address!r} cannot be listened on; choose a free port, as in 127.0.0.1:50051",
        )
    return port


def _on_signals(actions: Mapping[str, Callable[[], None]]) -> None:
    loop = asyncio.get_running_loop()
    for name, action in actions.items():
        try:
            loop.add_signal_handler(signal.Signals[name], action)
        except (KeyError, NotImplementedError, RuntimeError, ValueError):
            # Not the main thread, or a system without the signal: whoever embeds the server
            # stops it.
            continue


def _unless_quiet(workers: Workers, stopping: asyncio.Event) -> Callable[[], bool]:
    """Return a function that waits for quiet, and says whether the server was stopped instead.

    It is quiet when no request has been under way for a second: to compile beside one would slow
    it down.
    """
    busy = time.monotonic()

    def stopped() -> bool:
        nonlocal busy
        while not stopping.is_set() and time.monotonic() - busy < _QUIET:
            time.sleep(_LOOK)
            if not workers.idle:
                busy = time.monotonic()
        return stopping.is_set()

    return stopped


async def _first(warming: asyncio.Future[None], stopping: asyncio.Event) -> None:
    """Wait until the kernels are warm or the server is asked to stop."""
    stopped = asyncio.ensure_future(stopping.wait())
    either: set[asyncio.Future[Any]] = {warming, stopped}
    await asyncio.wait(either, return_when=asyncio.FIRST_COMPLETED)
    stopped.cancel()
    if warming.done():
        warming.result()
