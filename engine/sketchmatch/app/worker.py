"""The life of a worker: a process that does one request at a time, as the server tells it to."""

from __future__ import annotations

import faulthandler
import os
import pickle
import queue
import signal
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from socket import socket

from google.protobuf.message import Message

from sketchmatch.app.faults import told
from sketchmatch.app.frames import Flag, Frames, Says, failure, frame
from sketchmatch.app.jobs import answers
from sketchmatch.app.orders import Order
from sketchmatch.app.remembered import Remembered
from sketchmatch.app.setup import RequestLimits, Setup
from sketchmatch.kernels._jit import on_compile
from sketchmatch.model.labels import cleaned_sentence
from sketchmatch.model.limits import SourceLimits
from sketchmatch.pipeline.clock import Clock
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.selection import Defaults
from sketchmatch.pipeline.slices import is_helper
from sketchmatch.pipeline.warmup import warm_up, warm_up_others
from sketchmatch.registry import OWN_DISTRIBUTION, PluginRules, Registry, discover
from sketchmatch_proto.v1 import match_pb2
from sketchmatch_proto.v1.match_service_pb2 import MatchResponse

__all__ = [
    "LOOKUPS",
    "SECONDS",
    "WorkerSetup",
    "flags",
    "leave_signals_to_the_server",
    "live",
    "registry_of",
]

SECONDS = struct.Struct("!d")
"""How it is told what is left of a match."""

LOOKUPS = struct.Struct("!3I")
"""How a worker tells, at the end of each request, how often histograms were needed."""

_LOADING = 120.0
_ENDING = 0.1
"""Seconds in which threads may come to an end that a plugin has told to."""
_MOMENT = 0.005
_POLITE = 10
_FIRST_TO_GO = 500
_CHUNK = 65536


@dataclass(frozen=True)
class WorkerSetup:
    """What a worker answers requests with, beside the plugins that it has loaded.

    Attributes
    ----------
    defaults, sources, limits
        Of the server.
    patience
        Seconds without a sign of life after which the worker ends itself, should nobody be left to
        end it; None where it does nothing that could keep it from noticing.
    scenes
        The file of the scenes that are kept; None where none are.
    backwards
        Whether to compile the kernels that come last first, as another begins at the beginning.
    """

    defaults: Defaults
    sources: SourceLimits
    limits: RequestLimits
    patience: float | None
    scenes: Path | None = None
    backwards: bool = False


def live(connection: socket, distributions: tuple[str, ...], stranger: bool) -> None:
    """Answer requests until the server is gone; the entry of the process.

    Parameters
    ----------
    connection
        To the server.
    distributions
        Whose algorithms are loaded, beside the engine's own.
    stranger
        Whether some of them are not trusted: they get processor and memory last.
    """
    leave_signals_to_the_server()
    _go_first_where_memory_is_short()
    if stranger and hasattr(os, "nice"):
        os.nice(_POLITE)
    worker = _Worker(connection, distributions)
    if stranger:
        _end_unless_alive(_LOADING)
    threading.Thread(target=worker.listen, daemon=True).start()
    with on_compile(lambda _: worker.say(Says.COMPILING)):
        worker.work()


class _Worker:
    """What the two threads of a worker share: one listens while the other works."""

    def __init__(self, connection: socket, distributions: tuple[str, ...]) -> None:
        self._connection = connection
        self._distributions = distributions
        self._told: queue.SimpleQueue[tuple[int, bytes]] = queue.SimpleQueue()
        self._stop = threading.Event()
        self._clock: Clock | None = None
        self._curtailed: float | None = None
        self._setup: Setup
        self._patience: float | None = None
        self._remembered = Remembered(None)

    def say(self, kind: int, content: bytes = b"") -> None:
        """Send a frame; it is one sign of life."""
        if self._patience is not None:
            _end_unless_alive(self._patience)
        self._connection.sendall(frame(kind, content))

    def listen(self) -> None:
        """Hear the server, also while a request is under way; end the process when it is gone."""
        frames = Frames()
        while True:
            try:
                data = self._connection.recv(_CHUNK)
            except OSError:
                data = b""
            if not data:
                os._exit(0)  # a plugin may be at work in the main thread
            for kind, content in frames.cut(data):
                self._hear(kind, content)

    def work(self) -> None:
        """Do what the server says, one after the other."""
        _, content = self._told.get()
        registry = registry_of(self._distributions)
        given = self._set_up(content, registry)
        warm_up(registry, given.defaults, backwards=given.backwards)
        self.say(Says.READY)
        while True:
            if self._patience is not None:
                faulthandler.cancel_dump_traceback_later()
            kind, content = self._told.get()
            if kind == Says.SETUP:
                self._set_up(content, registry)
                continue
            try:
                self._do(kind, content)
            except Exception as error:
                _, _, where = told(error).partition("\n")
                self.say(Says.FAILED, failure(error, where))
            else:
                self.say(Says.ENDED, LOOKUPS.pack(*self._remembered.take_lookups()))

    def _hear(self, kind: int, content: bytes) -> None:
        match kind:
            case Says.STOP:
                self._stop.set()
            case Says.CURTAIL:
                (self._curtailed,) = SECONDS.unpack(content)
                if (clock := self._clock) is not None:
                    clock.curtail(self._curtailed)
            case Says.ORDER | Says.WARM:
                self._stop.clear()
                self._curtailed = None
                self._told.put((kind, content))
            case _:
                self._told.put((kind, content))

    def _set_up(self, content: bytes, registry: Registry) -> WorkerSetup:
        given: WorkerSetup = pickle.loads(content)
        if given.scenes != self._remembered.path:
            self._remembered.close()
            self._remembered = Remembered(given.scenes)
        self._setup = self._remembered.setup(
            Setup(Engine(registry, given.defaults, given.sources), given.limits),
            lambda described: self.say(Says.DESCRIBED, described.packed()),
        )
        self._patience = given.patience
        return given

    def _do(self, kind: int, content: bytes) -> None:
        if self._patience is not None:
            _end_unless_alive(self._patience)
        if kind == Says.WARM:
            self._warm_up_others()
            return
        order: Order = pickle.loads(content)
        job = order.job(self._setup.limits.max_request_bytes)
        try:
            with (
                self._telling_of_threads(),
                closing(answers(job, self._setup, self._begun)) as responses,
            ):
                for response in responses:
                    if self._stop.is_set():
                        break
                    self.say(Says.ANSWER | flags(response), response.SerializeToString())
        finally:
            self._clock = None

    @contextmanager
    def _telling_of_threads(self) -> Iterator[None]:
        """Say which threads go on that were not there before, if there are any."""
        before = _threads()
        try:
            yield
        finally:
            until = time.monotonic() + _ENDING
            while (left := _threads() - before) and time.monotonic() < until:
                time.sleep(_MOMENT)
            if left:
                names = ", ".join(sorted({thread.name for thread in left}))
                self.say(Says.LEFT, cleaned_sentence(names).encode())

    def _begun(self, clock: Clock) -> None:
        self._clock = clock
        if self._curtailed is not None:  # while the request was decoded
            clock.curtail(self._curtailed)

    def _warm_up_others(self) -> None:
        """Compile what requests may ask for, last of all that there is to do."""
        if hasattr(os, "nice"):
            os.nice(_POLITE)
        engine = self._setup.engine
        own = () if self._distributions == () else (OWN_DISTRIBUTION,)
        warm_up_others(engine.registry.without(*own), engine.defaults, self._stop.is_set)


@cache
def registry_of(distributions: tuple[str, ...]) -> Registry:
    """Return what some distributions offer, and the engine's own."""
    return discover(rules=PluginRules.of(allow=distributions))


def flags(response: Message) -> int:
    """Return what is to be known of a response without decoding it."""
    if not isinstance(response, MatchResponse):
        return 0
    news = Flag.NEWS if response.HasField("progress") else 0
    compiles = response.progress.phase == match_pb2.PHASE_COMPILE
    return news | (Flag.EARLY if response.HasField("accepted") or compiles else 0)


def _threads() -> set[threading.Thread]:
    """Return the threads of this process but for those that help with any request."""
    return {thread for thread in threading.enumerate() if not is_helper(thread)}


def _end_unless_alive(patience: float) -> None:
    """End the process if it is not called again in time, even while no Python can run."""
    faulthandler.dump_traceback_later(2.0 * patience, exit=True)


def heed_no_signals() -> None:
    """Ignore what a terminal or an init system sends to a whole group of processes."""
    for name in ("SIGINT", "SIGHUP", "SIGTERM"):
        if number := getattr(signal, name, None):
            signal.signal(number, signal.SIG_IGN)


def leave_signals_to_the_server() -> None:
    """Heed none, as :func:`heed_no_signals`, but in processes that a plugin starts."""
    own = os.getpid()

    def leave(number: int, _frame: object) -> None:
        if os.getpid() != own:  # a plugin ends a process that it has forked
            signal.signal(number, signal.SIG_DFL)
            os.kill(os.getpid(), number)

    heed_no_signals()
    signal.signal(signal.SIGTERM, leave)


def _go_first_where_memory_is_short() -> None:
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(str(_FIRST_TO_GO), encoding="ascii")
