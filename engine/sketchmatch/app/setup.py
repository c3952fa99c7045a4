"""What requests are answered with; all of it may be exchanged while a server runs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TypeVar

from sketchmatch.app.shelf import Shelf
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.processors import usable_cpus
from sketchmatch.registry import OWN_DISTRIBUTION, Registered, RegisteredReader
from sketchmatch.registry.distributions import canonical

__all__ = ["Isolation", "RequestLimits", "Setup", "SketchLimits"]

_Offered = TypeVar("_Offered", Registered, Registered | RegisteredReader)


@dataclass(frozen=True)
class SketchLimits:
    """How many sketches in progress a server keeps, and for how long.

    Attributes
    ----------
    sketches, of_one
        Of all callers, and of one.
    strokes
        Of one sketch.
    idle_seconds
        For which a sketch is kept that is neither drawn nor watched.
    """

    sketches: int = 1000
    of_one: int = 100
    strokes: int = 2000
    idle_seconds: float = 1800.0


@dataclass(frozen=True)
class RequestLimits:
    """What one request, and all requests together, may ask for.

    Attributes
    ----------
    max_request_bytes
        Size of one request. A little more passes the transport, so that the refusal can be clear.
    max_concurrent_matches
        Matches and segmentations that run at the same time, each in a place of its own.
    max_time_budget
        Seconds that one match may take, or None for no limit.
    max_waiting
        Requests that wait for a place.
    max_wait
        Seconds that one may wait.
    default_time_budget
        Seconds for a match that does not say how long it may take, or None for the most.
    max_waiting_bytes
        Bytes that all requests have together that wait.
    max_per_caller
        Requests of one caller that run at the same time, or None for all that may.
    max_per_minute
        Requests that one caller may begin in a minute, or None for no limit.
    max_stored_bytes
        Bytes of the scenes that one caller keeps, with their sources, or None for no limit.
    max_comparisons
        Numbers that the relations of one match may be compared by, or None for no limit: pairs of
        sketched objects × pairs of mapped objects × directions.
    max_candidates
        Maps that a search may weigh by its parameters, or None for no limit: those that its
        searcher says it makes at most.
    sketches
        How many sketches may be in progress.
    """

    max_request_bytes: int = 64 * 1024 * 1024
    max_concurrent_matches: int = 4 * usable_cpus()
    max_time_budget: float | None = None
    max_waiting: int = 500
    max_wait: float = 10.0

    @property
    def strangers_places(self) -> int:
        """Places that requests may take which ask for strangers' plugins: half of them."""
        return max(1, self.max_concurrent_matches // 2)

    default_time_budget: float | None = None
    max_waiting_bytes: int = 256 * 1024 * 1024
    max_per_caller: int | None = None
    max_per_minute: int | None = None
    max_stored_bytes: int | None = None
    max_comparisons: int | None = None
    max_candidates: int | None = None
    sketches: SketchLimits = SketchLimits()

    def time_budget(self, asked: float | None) -> float | None:
        """Return the seconds for a match that asks for so many, or None for no limit."""
        said = (asked or self.default_time_budget, self.max_time_budget)
        return min((seconds for seconds in said if seconds is not None), default=None)

    @property
    def transport_bytes(self) -> int:
        """Size above which the transport itself refuses a message."""
        return self.max_request_bytes + max(self.max_request_bytes // 8, 1 << 16)


@dataclass(frozen=True)
class Isolation:
    """Which plugins run in processes of their own, and how long these may keep silent.

    Attributes
    ----------
    trusted
        Canonical names of the distributions whose algorithms run in the server's own process,
        beside the engine's own; ``"*"`` stands for all.
    patience
        Seconds that such a process may go without a sign of life.
    """

    trusted: frozenset[str] = frozenset()
    patience: float = 30.0

    def strangers(self, algorithms: Iterable[_Offered]) -> tuple[_Offered, ...]:
        """Return those of some algorithms and readers that run in a process of their own."""
        if "*" in self.trusted:
            return ()
        trusted = {OWN_DISTRIBUTION, *self.trusted}
        return tuple(item for item in algorithms if canonical(item.distribution) not in trusted)


@dataclass(frozen=True)
class Setup:
    """What requests are answered with from now on.

    Attributes
    ----------
    engine
        Algorithms, defaults, and how large sources may be.
    limits
        What requests may ask for.
    isolation
        Which plugins run in processes of their own.
    strangers, trusted
        The algorithms and readers that do, and those that do not.
    plugins
        Whether there is any plugin beside the engine's own, be it one that failed.
    shelf
        The scenes that are kept; None where none are.
    """

    engine: Engine
    limits: RequestLimits = field(default_factory=RequestLimits)
    isolation: Isolation = field(default_factory=Isolation)
    shelf: Shelf | None = field(default=None, compare=False)
    strangers: tuple[Registered | RegisteredReader, ...] = field(init=False, repr=False)
    trusted: tuple[Registered | RegisteredReader, ...] = field(init=False, repr=False)
    plugins: bool = field(init=False, repr=False)

    def __post_init__(self) -> None:
        registry = self.engine.registry
        offered: tuple[Registered | RegisteredReader, ...] = (
            *registry.algorithms,
            *registry.readers,
        )
        strangers = self.isolation.strangers(offered)
        trusted = tuple(item for item in offered if item not in strangers)
        object.__setattr__(self, "strangers", strangers)
        object.__setattr__(self, "trusted", trusted)
        found = {item.distribution for item in (*offered, *registry.statuses)}
        object.__setattr__(self, "plugins", bool({*map(canonical, found)} - {OWN_DISTRIBUTION}))
