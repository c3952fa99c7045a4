"""The life of a server: start, warm up, serve, drain, stop."""

from __future__ import annotations

import asyncio
import logging
import signal
import socket
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import grpc
from google.protobuf.descriptor_pool import DescriptorPool
from grpc_health.v1 import health, health_pb2_grpc
from grpc_reflection.v1alpha import reflection

import sketchmatch
from sketchmatch.app.application import Application
from sketchmatch.app.archive import Archive
from sketchmatch.app.scenes import SceneArchive
from sketchmatch.app.setup import Setup
from sketchmatch.app.store import Store
from sketchmatch.config.addresses import is_of_this_machine
from sketchmatch.config.settings import KEPT_MIB
from sketchmatch.errors import InvalidInputError, Reason, SketchmatchError, StoreError
from sketchmatch.server.called import Handlers
from sketchmatch.server.callers import CallerInterceptor
from sketchmatch.server.calls import CallLogInterceptor
from sketchmatch.server.gateway import Gateway
from sketchmatch.server.interceptors import ErrorInterceptor, OpeningInterceptor
from sketchmatch.server.metrics import Metric, Metrics, MetricsInterceptor
from sketchmatch.server.monitor import Monitor
from sketchmatch.server.notify import notify
from sketchmatch.server.readiness import Readiness
from sketchmatch.server.reflected import Reflected
from sketchmatch.server.services import CatalogService, MatchService, SceneService, TransferService
from sketchmatch.server.sketching import SketchService
from sketchmatch.server.tls import TlsFiles, server_credentials, watched_pems
from sketchmatch.server.tokens import read_tokens
from sketchmatch.server.traces import Traces
from sketchmatch.server.watchdog import watch
from sketchmatch.server.watched import Watched
from sketchmatch_proto.v1 import (
    catalog_service_pb2,
    match_service_pb2,
    scene_service_pb2,
    sketch_service_pb2,
    transfer_service_pb2,
)

__all__ = ["ServerSettings", "serve"]

_log = logging.getLogger(__name__)

_ALL = 2**31 - 1
_MOST_AT_ONCE = 1000
_PING_MS = 10_000
_IDLE_MS = 600_000
_QUIET = 1.0
_DAY = 86_400.0
_LOOK = 0.05
_LOOK_AT_FILES = 1.0
_COMING_TO_AN_END = 4.0
"""Seconds of the grace, half of it at most, that matches have for coming to an end with what they
have: a judge takes longer on a machine that is busy."""

_SERVICES = (
    match_service_pb2.DESCRIPTOR.services_by_name["MatchService"].full_name,
    scene_service_pb2.DESCRIPTOR.services_by_name["SceneService"].full_name,
    catalog_service_pb2.DESCRIPTOR.services_by_name["CatalogService"].full_name,
    sketch_service_pb2.DESCRIPTOR.services_by_name["SketchService"].full_name,
    transfer_service_pb2.DESCRIPTOR.services_by_name["TransferService"].full_name,
)


_METHODS = tuple(
    f"/{service.full_name}/{method.name}"
    for file in (
        match_service_pb2,
        scene_service_pb2,
        catalog_service_pb2,
        sketch_service_pb2,
        transfer_service_pb2,
    )
    for service in file.DESCRIPTOR.services_by_name.values()
    for method in service.methods
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
    workers
        Processes that wait for requests at least; 0 to answer in threads of this process.
    patience
        Seconds after which a server that answers nothing ends its process; None for never, which
        is for servers in a process that does something else.
    tls
        The files of certificates; None: no encryption.
    tokens
        The file of the tokens of which each call must show one; None: calls need none.
    insecure
        Whether to listen where other machines reach the server though that lets strangers in, or
        read along.
    metrics_address
        Host and port for metrics and probes over HTTP; None for none.
    store
        The folder for what is kept beyond the life of the server; None for keeping nothing.
    web_address
        Host and port for browsers; None for none.
    web_origins
        Of pages from elsewhere that may call there.
    web_robots
        Addresses of ROS bridges that the sketch pad may send routes to.
    store_named
        Whether somebody named that folder, so that the server is not to start without it.
    matches_days, matches_bytes
        For how long matches are kept there, and how large their file may grow.
    scenes_bytes
        How large the file of kept scenes may grow.
    traces_endpoint
        URL of a collector of OpenTelemetry traces; None for none.
    """

    address: str = "127.0.0.1:50051"
    grace: float = 5.0
    workers: int = 0
    patience: float | None = None
    tls: TlsFiles | None = None
    tokens: Path | None = None
    insecure: bool = False
    metrics_address: str | None = None
    store: Path | None = None
    web_address: str | None = None
    web_origins: tuple[str, ...] = ()
    store_named: bool = True
    matches_days: float = 30.0
    matches_bytes: int = KEPT_MIB << 20
    scenes_bytes: int = KEPT_MIB << 20
    traces_endpoint: str | None = None
    web_robots: tuple[str, ...] = ()


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
        theirs. How large a request may be stays as it was at the start.
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
        If the address cannot be listened on, or must not without naming callers, or a file of
        certificates or tokens is of no use.
    """
    lacking = _refuse_strangers(settings)
    files = _Files(settings, say)
    metrics, setup = Metrics(_METHODS), load()
    store = _opened(settings, say)
    scenes, matches = _archives(store, settings, metrics)
    app = Application(setup, settings.workers, scenes, matches, metrics.matched, metrics.looked_up)
    traces = Traces.sent_to(settings.traces_endpoint)
    interceptors = [
        *traces.interceptors,
        MetricsInterceptor(metrics),
        CallLogInterceptor(),
        *files.interceptors,
        OpeningInterceptor(),
        ErrorInterceptor(),
    ]
    server = _grpc_server(interceptors, app.setup.limits.transport_bytes)
    readiness = Readiness(_SERVICES)
    services = _services(app)
    _add_services(server, services, readiness)
    _watch(metrics, app, files, readiness)
    port = _listen(server, settings.address, files.credentials)
    beside = _Beside(
        settings, app, files, Handlers(services, interceptors), metrics, readiness, traces
    )
    await readiness.know(app.setup.engine.registry.algorithms)
    await server.start()
    beside.start()
    unwatch = watch(settings.patience)
    stopping = stop or asyncio.Event()
    warming = _Warming(app, readiness, stopping)
    reloading = _Reloading(load, app, files, readiness, say, warming)
    _on_signals({"SIGTERM": stopping.set, "SIGINT": stopping.set, "SIGHUP": reloading.start})
    say(f"listening on {_found_at(settings.address, port)}")
    if lacking:
        beside.sentences.append(f"insecure: whoever reaches this address {lacking}")
    for sentence in (*beside.sentences, *app.setup.engine.registry.problems):
        say(sentence)
    try:
        await _first(asyncio.ensure_future(warming.begin(say)), stopping)
        if not stopping.is_set():
            await readiness.serve()
            say("serving")
            notify("READY=1")
            await _first(asyncio.ensure_future(warming.go_on()), stopping)
        await stopping.wait()
        notify("STOPPING=1")
        say(f"stopping; running matches may take {settings.grace:g} s more")
    finally:
        try:
            await _drain(server, beside, app, readiness, settings.grace)
        finally:
            await app.close()
            await beside.close()
            if store is not None:
                store.close()
            unwatch()
    say("stopped")


async def _drain(
    server: grpc.aio.Server, beside: _Beside, app: Application, readiness: Readiness, grace: float
) -> None:
    """Take nothing new, and let what is under way come to an end in so many seconds."""
    await readiness.drain()
    ending = asyncio.gather(server.stop(grace), beside.stop(grace))
    await app.drain(grace - min(_COMING_TO_AN_END, grace / 2))
    await ending


class _Files:
    """What tells friends from strangers, kept in files."""

    def __init__(self, settings: ServerSettings, say: Callable[[str], None]) -> None:
        self.pems = None if settings.tls is None else watched_pems(settings.tls, say)
        path = settings.tokens
        self._tokens = (
            None if path is None else Watched("the tokens", [path], lambda: read_tokens(path), say)
        )

    @property
    def credentials(self) -> grpc.ServerCredentials | None:
        """What encrypts; None for nothing."""
        return None if self.pems is None else server_credentials(self.pems)

    @property
    def interceptors(self) -> list[CallerInterceptor]:
        """What asks for tokens, if anything does."""
        return [] if self._tokens is None else [CallerInterceptor(self._tokens)]

    def expiry(self) -> dict[tuple[str, ...], float]:
        """Return when the certificate expires, as metrics have it."""
        expires = None if self.pems is None else self.pems.value.expires
        return {} if expires is None else {(): expires.timestamp()}

    def look(self) -> None:
        """Read again now what has changed."""
        for watched in (self.pems, self._tokens):
            if watched is not None:
                watched.look()

    async def watch(self) -> None:
        """Look every second, so that faults are said before anybody calls."""
        while self.pems is not None or self._tokens is not None:
            await asyncio.sleep(_LOOK_AT_FILES)
            try:
                await asyncio.to_thread(self.look)
            except Exception:  # nobody else would look from then on
                _log.exception("the check of the files of certificates and tokens failed")


class _Beside:
    """What is beside the gRPC server: watched files, monitors, browsers, a collector of traces.

    Attributes
    ----------
    sentences
        What to say of it to the person who started the server.
    """

    def __init__(
        self,
        settings: ServerSettings,
        app: Application,
        files: _Files,
        handlers: Handlers,
        metrics: Metrics,
        readiness: Readiness,
        traces: Traces,
    ) -> None:
        self.sentences: list[str] = []
        self._files, self._traces = files, traces
        self._watching: asyncio.Task[None] | None = None
        self._monitor: Monitor | None = None
        self._gateway: Gateway | None = None
        if settings.metrics_address:
            self._monitor = Monitor(settings.metrics_address, metrics, lambda: readiness.serving)
            self.sentences.append(f"metrics are at http://{self._monitor.address}/metrics")
        if settings.web_address:
            self._gateway = Gateway(
                settings.web_address,
                settings.web_origins,
                app,
                handlers,
                _SERVICES,
                settings.web_robots,
                files.pems,
            )
            self.sentences += self._gateway.sentences

    def start(self) -> None:
        """Answer from now on."""
        self._watching = asyncio.create_task(self._files.watch())
        if self._gateway:
            self._gateway.start()

    async def stop(self, grace: float) -> None:
        """Answer browsers nothing new, and leave so many seconds to what is under way."""
        if self._gateway:
            await self._gateway.stop(grace)

    async def close(self) -> None:
        """Tell monitors nothing more, and the collector of traces the last."""
        if self._watching:
            self._watching.cancel()
        if self._monitor:
            await asyncio.to_thread(self._monitor.close)
        await asyncio.to_thread(self._traces.close)


class _Warming:
    """Has compiled what requests need, and says what is ready."""

    def __init__(self, app: Application, readiness: Readiness, stopping: asyncio.Event) -> None:
        self._app, self._readiness, self._stopping = app, readiness, stopping
        self._latest = 0

    async def begin(self, say: Callable[[str], None]) -> None:
        """Compile what the default pipeline needs."""
        await self._app.start(say, self._stopping.is_set, self._readiness.ready)

    async def again(self) -> None:
        """Compile what another setup needs."""
        await self._app.warm_up(self._stopping.is_set, self._readiness.ready)
        await self.go_on()

    async def go_on(self) -> None:
        """Compile the rest, while no request is under way; a later call takes the place of it.

        Those that wait for quiet would else take all threads of a server that is reloaded while it
        is busy, and nothing else would have its turn in them.
        """
        self._latest += 1
        own = self._latest
        unwanted = _unless_quiet(self._app, lambda: self._stopping.is_set() or self._latest != own)
        await self._app.warm_up_others(unwanted, self._readiness.ready)


class _Reloading:
    """Exchanges the setup, one load at a time."""

    def __init__(
        self,
        load: Callable[[], Setup],
        app: Application,
        files: _Files,
        readiness: Readiness,
        say: Callable[[str], None],
        warming: _Warming,
    ) -> None:
        self._load = load
        self._app = app
        self._files = files
        self._readiness = readiness
        self._say = say
        self._warming = warming
        self._one_at_a_time = asyncio.Lock()
        self._tasks: set[asyncio.Task[None]] = set()

    def start(self) -> None:
        task = asyncio.create_task(self._reload())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _reload(self) -> None:
        async with self._one_at_a_time:
            await asyncio.to_thread(self._files.look)
            try:
                setup = await asyncio.to_thread(self._load)
            except SketchmatchError as error:
                self._say(f"the configuration was not reloaded: {error}")
                return
            self._app.change(self._of_former_size(setup))
            await self._readiness.know(setup.engine.registry.algorithms)
            for problem in setup.engine.registry.problems:
                self._say(problem)
            self._say("the configuration is reloaded")
        await self._warming.again()

    def _of_former_size(self, setup: Setup) -> Setup:
        """Return a setup for requests as large as the ports take them since the start."""
        former = self._app.setup.limits.max_request_bytes
        if setup.limits.max_request_bytes != former:
            self._say("server.max_request_mib does not change before the server is started again")
        return replace(setup, limits=replace(setup.limits, max_request_bytes=former))


def _watch(metrics: Metrics, app: Application, files: _Files, readiness: Readiness) -> None:
    """Have metrics tell how things are, beside what happened."""
    metrics.watch(
        Metric("sketchmatch_build_info", "Version of the server.", ("version",)),
        lambda: {(sketchmatch.__version__,): 1.0},
    )
    metrics.watch(
        Metric("sketchmatch_serving", "Whether requests are answered."),
        lambda: {(): float(readiness.serving)},
    )
    metrics.watch(
        Metric("sketchmatch_algorithm_ready", "Whether kernels are compiled.", ("algorithm",)),
        lambda: {(name,): float(ready) for name, ready in readiness.states().items()},
    )
    metrics.watch(
        Metric("sketchmatch_requests_limit", "Requests that may run at the same time."),
        lambda: {(): float(app.setup.limits.max_concurrent_matches)},
    )
    metrics.watch(
        Metric("sketchmatch_requests", "Requests that run, or wait for their turn.", ("state",)),
        lambda: {
            ("running",): float(app.load.running),
            ("waiting",): float(app.load.waiting),
        },
    )
    metrics.watch(
        Metric("sketchmatch_waiting_bytes", "Bytes of the requests that wait for their turn."),
        lambda: {(): float(app.load.waiting_bytes)},
    )
    metrics.watch(
        Metric("sketchmatch_workers", "Worker processes.", ("state",)),
        lambda: {
            ("busy",): float(app.load.busy_workers),
            ("idle",): float(app.load.workers - app.load.busy_workers),
        },
    )
    metrics.watch(
        Metric(
            "sketchmatch_certificate_expires_timestamp_seconds",
            "When the server's certificate expires.",
        ),
        files.expiry,
    )


def _opened(settings: ServerSettings, say: Callable[[str], None]) -> Store | None:
    """Return the folder in which things are kept; None for none, which is said if it is no choice.

    Raises
    ------
    InvalidInputError
        If somebody named one that is of no use.
    """
    if settings.store is None:
        return None
    try:
        return Store(settings.store)
    except StoreError as error:
        if settings.store_named:
            problem = f"cannot be used: {error}"
            raise InvalidInputError(Reason.INVALID_FIELD, "server.store", problem) from None
        say(f"nothing is kept after this server stops: {error}")
        return None


def _archives(
    store: Store | None, settings: ServerSettings, metrics: Metrics
) -> tuple[SceneArchive | None, Archive | None]:
    """Return where scenes are kept, and matches; None for nowhere."""
    if store is None:
        return None, None
    matches = Archive(
        store,
        settings.matches_days * _DAY,
        settings.matches_bytes,
        lambda count: metrics.unkept.add(count=count),
    )
    return SceneArchive(store, settings.scenes_bytes), matches


def _grpc_server(
    interceptors: Sequence[grpc.aio.ServerInterceptor], largest: int
) -> grpc.aio.Server:
    """Return a server of messages of so many bytes at most."""
    return grpc.aio.server(
        interceptors=interceptors,
        options=[
            ("grpc.max_receive_message_length", largest),
            ("grpc.max_send_message_length", -1),
            # A few bytes may become very many: they are inflated once there is a place for them.
            ("grpc.per_message_decompression", 0),
            # Of many calls at once gRPC would cancel some without a word; we say when to come back.
            ("grpc.server.max_pending_requests", _ALL),
            ("grpc.server.max_pending_requests_hard_limit", _ALL),
            ("grpc.server_max_unrequested_time_in_server", _ALL),
            # What waits costs memory: of one connection the rest waits with the caller.
            ("grpc.max_concurrent_streams", _MOST_AT_ONCE),
            # A caller who is frozen or cut off keeps its place for 20 s and no longer.
            ("grpc.keepalive_time_ms", _PING_MS),
            ("grpc.keepalive_timeout_ms", _PING_MS),
            ("grpc.http2.ping_timeout_ms", _PING_MS),
            ("grpc.keepalive_permit_without_calls", 1),
            ("grpc.http2.max_pings_without_data", 0),
            # Who has not called for long connects anew when it does.
            ("grpc.max_connection_idle_ms", _IDLE_MS),
            # Clients ping every 30 s; by default the server would hang up on them.
            ("grpc.http2.min_ping_interval_without_data_ms", 20_000),
            # Otherwise a second server on the same port would silently take half of the calls.
            ("grpc.so_reuseport", 0),
        ],
    )


def _services(app: Application) -> tuple[grpc.GenericRpcHandler, ...]:
    """Return what answers the services of the contract, on whichever port."""
    services = (MatchService, SceneService, SketchService, TransferService, CatalogService)
    return tuple(service(app).handler() for service in services)


def _add_services(
    server: grpc.aio.Server, services: tuple[grpc.GenericRpcHandler, ...], readiness: Readiness
) -> None:
    server.add_generic_rpc_handlers(services)
    health_pb2_grpc.add_HealthServicer_to_server(readiness.servicer, server)
    reflection.enable_server_reflection(
        (*_SERVICES, health.SERVICE_NAME, reflection.SERVICE_NAME),
        server,
        cast(DescriptorPool, Reflected()),
    )


def _refuse_strangers(settings: ServerSettings) -> str:
    """Refuse to let strangers in from other machines; return what they can do where that is meant.

    Raises
    ------
    InvalidInputError
        If they could, and nobody said so.
    """
    reached = {"address": settings.address, "server.web_address": settings.web_address}
    open_to_all = [
        (named, address)
        for named, address in reached.items()
        if address and not is_of_this_machine(address)
    ]
    if not open_to_all:
        return ""
    knows_callers = settings.tokens or (settings.tls and settings.tls.client_ca)
    faults = [
        *([] if knows_callers else ["may call"]),
        *(
            []
            if settings.tls
            else ["can read along, tokens too" if settings.tokens else "can read along"]
        ),
    ]
    lacking = " and ".join(faults)
    if lacking and not settings.insecure:
        remedies = [
            *([] if settings.tls else ["--tls-certificate and --tls-key"]),
            *([] if knows_callers else ["--tokens or --tls-client-ca"]),
        ]
        named, address = open_to_all[0]
        raise InvalidInputError(
            Reason.INVALID_FIELD,
            named,
            f"{address!r} can be reached from other machines, and whoever reaches it {lacking}; "
            f"give {', and '.join(remedies)}, listen on 127.0.0.1, or allow this with --insecure",
        )
    return lacking


def _listen(
    server: grpc.aio.Server, address: str, credentials: grpc.ServerCredentials | None
) -> int:
    local = address.startswith("unix")
    try:
        if _is_taken(address):
            port = 0
        elif credentials is None:
            port = server.add_insecure_port(address)
        else:
            port = server.add_secure_port(address, credentials)
    except RuntimeError:
        port = 0
    if port == 0:
        remedy = "name a file that no server uses" if local else "choose a free port"
        example = "unix:/run/sketchmatch.sock" if local else "127.0.0.1:50051"
        raise InvalidInputError(
            Reason.INVALID_FIELD,
            "address",
            f"{address!r} cannot be listened on; {remedy}, as in {example}",
        )
    return port


def _is_taken(address: str) -> bool:
    """Whether somebody listens at a file; gRPC would take it away from them without a word."""
    if not address.startswith("unix:") or not hasattr(socket, "AF_UNIX"):
        return False
    path = address.removeprefix("unix:").removeprefix("//")
    with socket.socket(socket.AF_UNIX) as probe:
        try:
            probe.connect(path)
        except OSError:
            return False
    return True


def _found_at(address: str, port: int) -> str:
    """Return where clients find a server: a port may have been picked, a file has none."""
    return address if address.startswith("unix") else f"{address.rpartition(':')[0]}:{port}"


def _on_signals(actions: Mapping[str, Callable[[], None]]) -> None:
    loop = asyncio.get_running_loop()
    for name, action in actions.items():
        try:
            loop.add_signal_handler(signal.Signals[name], action)
        except (KeyError, NotImplementedError, RuntimeError, ValueError):
            # Not the main thread, or a system without the signal: whoever embeds the server
            # stops it.
            continue


def _unless_quiet(app: Application, unwanted: Callable[[], bool]) -> Callable[[], bool]:
    """Return a function that waits for quiet, and says whether nobody wants it any more instead.

    It is quiet when no request has been under way for a second: to compile beside one would slow
    it down.
    """
    busy = time.monotonic()

    def stopped() -> bool:
        nonlocal busy
        while not unwanted() and time.monotonic() - busy < _QUIET:
            time.sleep(_LOOK)
            if not app.idle:
                busy = time.monotonic()
        return unwanted()

    return stopped


async def _first(warming: asyncio.Future[None], stopping: asyncio.Event) -> None:
    """Wait until the kernels are warm or the server is asked to stop."""
    stopped = asyncio.ensure_future(stopping.wait())
    either: set[asyncio.Future[Any]] = {warming, stopped}
    await asyncio.wait(either, return_when=asyncio.FIRST_COMPLETED)
    stopped.cancel()
    if warming.done():
        warming.result()
