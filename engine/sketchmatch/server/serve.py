"""The life of a server: start, warm up, serve, drain, stop."""

from __future__ import annotations

import asyncio
import logging
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import grpc
from grpc_health.v1 import health, health_pb2, health_pb2_grpc
from grpc_reflection.v1alpha import reflection

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.pipeline.warmup import announcing_compilation, warm_up, warm_up_others
from sketchmatch.registry import Registry
from sketchmatch.server.limits import Limits
from sketchmatch.server.services import CatalogService, MatchService, SceneService, Workers
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

_log = logging.getLogger(__name__)
_SERVICES = (
    match_service_pb2.DESCRIPTOR.services_by_name["MatchService"].full_name,
    scene_service_pb2.DESCRIPTOR.services_by_name["SceneService"].full_name,
    catalog_service_pb2.DESCRIPTOR.services_by_name["CatalogService"].full_name,
)


@dataclass(frozen=True)
class ServerSettings:
    """How to serve.

    Attributes
    ----------
    address
        Host and port to listen on; port 0 picks a free one.
    grace
        Seconds that running matches are given when the server is asked to stop.
    limits
        What requests may ask for.
    """

    address: str = "127.0.0.1:50051"
    grace: float = 5.0
    limits: Limits = field(default_factory=Limits)


async def serve(
    registry: Registry,
    settings: ServerSettings,
    say: Callable[[str], None],
    stop: asyncio.Event | None = None,
) -> None:
    """Serve until SIGTERM, SIGINT, or ``stop`` is set.

    Parameters
    ----------
    registry
        The algorithms to offer.
    settings
        How to serve.
    say
        Called with sentences for the person who started the server.
    stop
        Ends the server from within the process.

    Raises
    ------
    InvalidInputError
        If the address cannot be listened on.
    """
    workers = Workers(settings.limits)
    server = grpc.aio.server(
        options=[
            ("grpc.max_receive_message_length", settings.limits.transport_bytes),
            ("grpc.max_send_message_length", -1),
            # Clients ping every 30 s; by default the server would hang up on them.
            ("grpc.http2.min_ping_interval_without_data_ms", 20_000),
            # Otherwise a second server on the same port would silently take half of the calls.
            ("grpc.so_reuseport", 0),
        ]
    )
    checks = _add_services(server, registry, workers)
    port = _listen(server, settings.address)
    await checks.set("", health_pb2.HealthCheckResponse.NOT_SERVING)
    await server.start()
    stopping = stop or asyncio.Event()
    _stop_on_signals(stopping)
    host = settings.address.rpartition(":")[0]
    say(f"listening on {host}:{port}")
    try:
        with announcing_compilation(say):
            warming = asyncio.to_thread(warm_up, registry, stopping.is_set)
            await _first(asyncio.ensure_future(warming), stopping)
        if not stopping.is_set():
            for name in ("", *_SERVICES):
                await checks.set(name, health_pb2.HealthCheckResponse.SERVING)
            say("serving")
            others = asyncio.to_thread(warm_up_others, registry, _unless_quiet(workers, stopping))
            await _first(asyncio.ensure_future(others), stopping)
        await stopping.wait()
        say(f"stopping; running matches have {settings.grace:g} s to end")
    finally:
        await checks.enter_graceful_shutdown()
        await server.stop(settings.grace)
        await workers.close()
    say("stopped")


def _add_services(
    server: grpc.aio.Server, registry: Registry, workers: Workers
) -> health.aio.HealthServicer:
    match_service_pb2_grpc.add_MatchServiceServicer_to_server(
        MatchService(registry, workers), server
    )
    scene_service_pb2_grpc.add_SceneServiceServicer_to_server(
        SceneService(registry, workers), server
    )
    catalog_service_pb2_grpc.add_CatalogServiceServicer_to_server(
        CatalogService(registry, workers.limits), server
    )
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


def _stop_on_signals(stopping: asyncio.Event) -> None:
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        try:
            loop.add_signal_handler(number, stopping.set)
        except (NotImplementedError, RuntimeError, ValueError):
            # Not the main thread, or a system without signals: whoever embeds the server stops it.
            return


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
