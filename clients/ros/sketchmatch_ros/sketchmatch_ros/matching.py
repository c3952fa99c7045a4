"""Asks the server about the latest map, and can be told to stop; it knows nothing of ROS."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

from sketchmatch_client import Client, Match, MatchCall, Progress
from sketchmatch_proto.v1.source_pb2 import Source

__all__ = ["Carrier", "Features", "Matching", "Options"]

_LOOK_SECONDS = 0.05

XY = tuple[float, float]


@dataclass(frozen=True)
class Options:
    """How to match; what is empty or 0 is the server's to decide.

    Attributes
    ----------
    profile
        Name of a pipeline.
    time_budget
        Seconds after which the best match so far is the answer.
    seed
        Of everything random.
    timeout
        Seconds after which a call is given up.
    """

    profile: str = ""
    time_budget: float = 0.0
    seed: int = 0
    timeout: float = 0.0


@dataclass(frozen=True)
class Features:
    """Routes and zones, y upwards: in a sketch as its objects are, or in the map's frame.

    Attributes
    ----------
    routes
        Ways to drive, each a list of places; empty where one cannot be carried.
    zones
        Outlines of areas to keep out of; empty where one cannot be carried.
    """

    routes: Sequence[Sequence[XY]] = ()
    zones: Sequence[Sequence[XY]] = ()


class Carrier(Protocol):
    """Carries routes and zones of a sketch into the map's frame.

    This is where a server's transfer plugs in: a node that has none publishes no route and no mask.
    """

    def __call__(
        self,
        client: Client,
        sketch: Source,
        map_: Source,
        partners: Mapping[int, int],
        drawn: Features,
        radius: float,
    ) -> Features:
        """Return each route and each zone as it is on the map, in the order of those drawn.

        Parameters
        ----------
        client
            Asks the server.
        sketch, map_
            What was matched.
        partners
            Which sketched object is which mapped one, by index.
        drawn
            What is to be carried.
        radius
            How far routes are kept away from obstacles, in metres.

        Raises
        ------
        SketchmatchError
            If nothing can be carried.
        """


class Matching:
    """Matches that go on, each of which can be stopped.

    Parameters
    ----------
    client
        Asks the server.
    """

    def __init__(self, client: Client) -> None:
        self._client = client
        self._lock = threading.Lock()
        self._running: set[MatchCall] = set()

    def match(
        self,
        sketch: Source,
        map_: Source,
        options: Options,
        *,
        on_progress: Callable[[Progress], object],
        is_cancelled: Callable[[], bool],
    ) -> Match:
        """Match, and tell how far it is; the search ends soon after ``is_cancelled`` says so.

        Raises
        ------
        CallCancelledError
            If it was cancelled or stopped.
        SketchmatchError
            As the client's calls do.
        """
        call = self._client.events(
            sketch,
            map_,
            timeout=options.timeout or None,
            profile=options.profile or None,
            time_budget=options.time_budget or None,
            seed=options.seed,
        )
        with self._known(call), _stopped_when(is_cancelled, call):
            return call.result(on_progress)

    def stop(self) -> None:
        """Stop all that go on."""
        with self._lock:
            for call in self._running:
                call.cancel()

    @contextmanager
    def _known(self, call: MatchCall) -> Iterator[None]:
        with self._lock:
            self._running.add(call)
        try:
            yield
        finally:
            with self._lock:
                self._running.discard(call)


@contextmanager
def _stopped_when(is_cancelled: Callable[[], bool], call: MatchCall) -> Iterator[None]:
    """Look, from a thread of its own, whether a call shall be stopped.

    What asks for it may not stop it itself: a goal of ROS is being cancelled only after those who
    were asked have agreed, and one that ends before may not say that it was.
    """
    over = threading.Event()

    def look() -> None:
        while not over.wait(_LOOK_SECONDS):
            if is_cancelled():
                call.cancel()
                return

    watcher = threading.Thread(target=look, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        over.set()
        watcher.join()
