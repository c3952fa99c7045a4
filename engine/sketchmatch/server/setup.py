"""What a server works with; all of it may be exchanged while it runs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from sketchmatch.pipeline.selection import Defaults
from sketchmatch.registry import OWN_DISTRIBUTION, Registered, Registry
from sketchmatch.registry.plugins import canonical
from sketchmatch.server.limits import Limits

__all__ = ["Current", "Isolation", "Setup"]


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

    def strangers(self, algorithms: Iterable[Registered]) -> tuple[Registered, ...]:
        """Return those of some algorithms that run in a process of their own."""
        if "*" in self.trusted:
            return ()
        trusted = {OWN_DISTRIBUTION, *self.trusted}
        return tuple(item for item in algorithms if canonical(item.distribution) not in trusted)


@dataclass(frozen=True)
class Setup:
    """What requests are answered with from now on.

    Attributes
    ----------
    registry
        The algorithms.
    defaults
        What is taken where a request chooses nothing, and the profiles that it can name.
    limits
        What requests may ask for.
    isolation
        Which plugins run in processes of their own.
    """

    registry: Registry
    defaults: Defaults = field(default_factory=Defaults)
    limits: Limits = field(default_factory=Limits)
    isolation: Isolation = field(default_factory=Isolation)


class Current:
    """Holds the setup in force; a request takes it once and keeps it to its end."""

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
