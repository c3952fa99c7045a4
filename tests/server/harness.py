"""Real servers on free ports of this machine, and what to ask them."""

import asyncio
import re
import threading
import time
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from functools import cache
from typing import Any, TypeVar

import numpy as np

from sketchmatch.api import Algorithm
from sketchmatch.app.setup import Isolation, RequestLimits, Setup
from sketchmatch.model.limits import SourceLimits
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.selection import UNCONFIGURED, Defaults
from sketchmatch.registry import Kind, Registered, Registry, default_registry
from sketchmatch.server.serve import ServerSettings, serve
from sketchmatch_client import ServerBusyError, sources
from sketchmatch_proto.v1 import source_pb2

_Answer = TypeVar("_Answer")

ENDLESS = {
    "searcher": "easm",
    "params": {"searcher": {"patience": 10_000_000, "generations": 10_000_000}},
}
"""A searcher with parameters with which it goes on until it is stopped."""

# No search outlives its test, whatever fails to stop it.
_LONGEST = {"max_time_budget": 20.0}


class Host:
    """A server in the event loop that all servers of this process share.

    gRPC's asyncio serves several loops in one process, but not one that closes.
    """

    def __init__(self, setup: Setup | Callable[[], Setup], settings: ServerSettings) -> None:
        self.said: list[str] = []
        self.address = ""
        self.serving = threading.Event()
        self._listening = threading.Event()
        self._stop = asyncio.Event()
        load = setup if callable(setup) else lambda: setup
        self._end = in_loop(serve(load, settings, self._say, self._stop))
        self._end.add_done_callback(lambda _: self._listening.set())

    def wait_until_listening(self) -> None:
        assert self._listening.wait(30), "the server does not listen"
        if self._end.done():
            self._end.result()

    def stop(self) -> None:
        _loop().call_soon_threadsafe(self._stop.set)

    def join(self) -> None:
        self._end.result(30)

    def _say(self, sentence: str) -> None:
        self.said.append(sentence)
        if found := re.match(r"listening on (\S+)", sentence):
            self.address = found[1]
            self._listening.set()
        if sentence == "serving":
            self.serving.set()


def in_loop(work: Coroutine[Any, Any, _Answer]) -> Future[_Answer]:
    """Run a coroutine in the event loop of the servers."""
    return asyncio.run_coroutine_threadsafe(work, _loop())


@cache
def _loop() -> asyncio.AbstractEventLoop:
    loop = asyncio.new_event_loop()
    threading.Thread(target=loop.run_forever, daemon=True).start()
    return loop


@contextmanager
def serving(
    *plugins: type[Algorithm],
    warm: bool = True,
    grace: float = 0.0,
    defaults: Defaults = UNCONFIGURED,
    sources: SourceLimits = SourceLimits(),  # noqa: B008
    **limits: float,
) -> Iterator[Host]:
    """Run a server that offers the built-in algorithms and ``plugins``, without workers."""
    setup = serving_setup(*plugins, defaults=defaults, sources=sources, **limits)
    with hosting(setup, warm, grace) as host:
        yield host


def serving_setup(
    *plugins: type[Algorithm],
    defaults: Defaults = UNCONFIGURED,
    sources: SourceLimits = SourceLimits(),  # noqa: B008
    **limits: float,
) -> Setup:
    """Return what a server answers with that offers the built-in algorithms and ``plugins``."""
    return Setup(
        Engine(registry_with(*plugins), defaults, sources),
        RequestLimits(**{**_LONGEST, **limits}),
        Isolation(trusted=frozenset("*")),
    )


@contextmanager
def hosting(setup: Setup, warm: bool = True, grace: float = 0.0, **settings: Any) -> Iterator[Host]:
    """Run a server with a setup, and settings beside its address."""
    host = Host(setup, ServerSettings("127.0.0.1:0", grace, **settings))
    try:
        host.wait_until_listening()
        if warm:
            assert host.serving.wait(120), "the server does not serve"
        yield host
    finally:
        host.stop()
        host.join()


def registry_with(*plugins: type[Algorithm]) -> Registry:
    known = default_registry()
    added = [Registered(_kind(plugin), plugin, "acme-plugins", "1.2") for plugin in plugins]
    return Registry([*known.algorithms, *added], known.statuses)


def _kind(plugin: type[Algorithm]) -> Kind:
    return next(kind for kind in Kind if issubclass(plugin, kind.interface))


def shapes(count: int, seed: int = 0) -> list[np.ndarray]:
    """Return random star-shaped polygons that lie apart from each other."""
    rng = np.random.default_rng(seed)
    across = int(np.ceil(np.sqrt(count)))
    places = np.stack(np.divmod(rng.permutation(across * across)[:count], across), axis=1)
    return [_star(rng) + 3.0 * place + rng.uniform(-0.4, 0.4, 2) for place in places]


def _star(rng: np.random.Generator) -> np.ndarray:
    corners = int(rng.integers(4, 9))
    angles = 2 * np.pi * (np.arange(corners) + rng.uniform(0, 0.5, corners)) / corners
    return rng.uniform(0.4, 1.0, (corners, 1)) * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def turned(polygons: list[np.ndarray], degrees: float = 40.0) -> list[np.ndarray]:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return [2.0 * polygon @ np.array([[c, s], [-s, c]]) for polygon in polygons]


def scene(count: int, seed: int = 0, labels: list[str] | None = None) -> source_pb2.Source:
    """Return a source of random polygons."""
    return sources.polygons(shapes(count, seed), labels)


def when_there_is_room(call: Callable[[], _Answer], seconds: float = 30.0) -> _Answer:
    """Call until the server is no longer busy; a stopped search takes a moment to end."""
    deadline = time.monotonic() + seconds
    while True:
        try:
            return call()
        except ServerBusyError:
            assert time.monotonic() < deadline, "the place is never given back"
            time.sleep(0.01)


def kinds(events: list) -> list[str]:
    return [event.WhichOneof("event") for event in events]
