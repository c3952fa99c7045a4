"""Asks the server about the latest map, and can be told to stop; it knows nothing of ROS."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Protocol, TypeVar

from sketchmatch_client import (
    CallCancelledError,
    Client,
    Match,
    MatchCall,
    NotFoundError,
    Progress,
    SketchmatchError,
    sources,
)
from sketchmatch_proto.v1.source_pb2 import Source

__all__ = ["Carrier", "Features", "KeptMap", "Matching", "Options"]

_LOOK_SECONDS = 0.05
_DELETE_SECONDS = 2.0

T = TypeVar("T")
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
    """

    profile: str = ""
    time_budget: float = 0.0
    seed: int = 0


@dataclass(frozen=True)
class Features:
    """Routes and zones, y upwards: in a sketch as its objects are, or in the map's frame.

    Attributes
    ----------
    routes
        Ways to drive, each a list of places; empty where one cannot be carried.
    zones
        Outlines of areas to keep out of; empty where one cannot be carried.
    notes
        What was changed about them in carrying, or could not be had, each a sentence for people.
    """

    routes: Sequence[Sequence[XY]] = ()
    zones: Sequence[Sequence[XY]] = ()
    notes: Sequence[str] = ()


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


class KeptMap:
    """The latest map as the server keeps it, so that goals need not bring it each time.

    Parameters
    ----------
    client
        Asks the server.
    """

    def __init__(self, client: Client) -> None:
        self._client = client
        self._lock = threading.Lock()
        self._of: tuple[Source, str] | None = None
        self._kept: Source | None = None
        self._ours = ""

    def keep(self, map_: Source, profile: str) -> Source:
        """Have the server keep a map in place of the one before, and return how it is named.

        Where the server keeps none, and of rooms, which are cut to fit each sketch, it is the map.
        """
        with self._lock:
            if self._of != (map_, profile):
                before, self._ours = self._ours, ""
                self._of, self._kept = (map_, profile), None
                # What is wrong with the map or the server a match will tell.
                with suppress(SketchmatchError):
                    self._put(map_, profile, before)
                if before != self._ours:
                    self._delete(before)
            return self._kept or map_

    def named(self, map_: Source) -> Source:
        """Return how a map is named if it is the one that is kept, and else the map."""
        with self._lock:
            is_latest = self._of is not None and self._of[0] == map_
            return (is_latest and self._kept) or map_

    def forget(self) -> None:
        """Take it that the server keeps nothing any more, as after a restart without its store."""
        with self._lock:
            self._of, self._kept, self._ours = None, None, ""

    def close(self) -> None:
        """Have the server keep nothing any more."""
        with self._lock:
            self._delete(self._ours)
        self.forget()

    def _put(self, map_: Source, profile: str, before: str) -> None:
        put = self._client.put_scene(map_, profile=profile or None, title="a robot's map")
        name = put.stored_scene.name
        if put.created or name == before:  # what was there already is somebody else's to delete
            self._ours = name
        if not put.stored_scene.passages:
            self._kept = sources.stored_scene(name)

    def _delete(self, name: str) -> None:
        if name:
            with suppress(SketchmatchError):
                self._client.delete_scene(name, timeout=_DELETE_SECONDS)


class Matching:
    """Matches with the latest map, and carries to it, until a goal is over.

    Parameters
    ----------
    client
        Asks the server; its timeout is that of every call.
    """

    def __init__(self, client: Client) -> None:
        self._client = client
        self._map = KeptMap(client)

    def match(
        self,
        sketch: Source,
        map_: Source,
        options: Options,
        *,
        on_progress: Callable[[Progress], object],
        is_over: Callable[[], bool],
    ) -> Match:
        """Match, and tell how far it is; the search ends soon after ``is_over`` says so.

        Raises
        ------
        CallCancelledError
            If it was over before its end.
        SketchmatchError
            As the client's calls do.
        """

        def matched(source: Source) -> Match:
            return self._matched(sketch, source, options, on_progress, is_over)

        kept = _unless(is_over, lambda: self._map.keep(map_, options.profile))
        return self._unless_lost(matched, kept, map_)

    def carried(
        self, carry: Callable[[Source], Features], map_: Source, is_over: Callable[[], bool]
    ) -> Features:
        """Return what is carried onto a map, which the server may keep.

        Raises
        ------
        CallCancelledError
            If ``is_over`` said so before its end.
        SketchmatchError
            As ``carry`` does.
        """
        return _unless(is_over, lambda: self._unless_lost(carry, self._map.named(map_), map_))

    def close(self) -> None:
        """Have the server keep no map any more."""
        self._map.close()

    def _unless_lost(self, ask: Callable[[Source], T], kept: Source, map_: Source) -> T:
        """Ask with the map itself where the server does not keep it any more."""
        try:
            return ask(kept)
        except NotFoundError:
            if kept is map_:
                raise
            self._map.forget()
            return ask(map_)

    def _matched(
        self,
        sketch: Source,
        map_: Source,
        options: Options,
        on_progress: Callable[[Progress], object],
        is_over: Callable[[], bool],
    ) -> Match:
        call = self._client.events(
            sketch,
            map_,
            profile=options.profile or None,
            time_budget=options.time_budget or None,
            seed=options.seed,
        )
        with _stopped_when(is_over, call):
            return call.result(on_progress)


@contextmanager
def _stopped_when(is_over: Callable[[], bool], call: MatchCall) -> Iterator[None]:
    """Look, from a thread of its own, whether a call shall be stopped.

    What asks for it may not stop it itself: a goal of ROS is being cancelled only after those who
    were asked have agreed, and one that ends before may not say that it was.
    """
    ended = threading.Event()

    def look() -> None:
        while not ended.wait(_LOOK_SECONDS):
            if is_over():
                call.cancel()
                return

    watcher = threading.Thread(target=look, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        ended.set()
        watcher.join()


def _unless(is_over: Callable[[], bool], work: Callable[[], T]) -> T:
    """Return what ``work`` does in a thread of its own, or raise soon after ``is_over`` says so.

    Calls that have one answer cannot be stopped: they are left to their timeout.
    """
    answer: Future[T] = Future()

    def run() -> None:
        try:
            answer.set_result(work())
        except BaseException as error:
            answer.set_exception(error)

    if not is_over():
        threading.Thread(target=run, daemon=True).start()
        while not is_over():
            if wait([answer], _LOOK_SECONDS).done:
                return answer.result()
    raise CallCancelledError("the goal was cancelled before its end")
