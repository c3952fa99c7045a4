"""Which plugins there are, which of them may be used, and what became of each."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from typing import Self

__all__ = [
    "EVERY_PLUGIN",
    "OWN_DISTRIBUTION",
    "PluginRules",
    "PluginState",
    "PluginStatus",
    "canonical",
]

OWN_DISTRIBUTION = "sketchmatch"
"""The distribution that the engine and the built-in algorithms come in."""


@lru_cache(maxsize=1024)
def canonical(distribution: str) -> str:
    """Return a distribution's name as the packaging standards compare it.

    Examples
    --------
    >>> canonical("Acme_Search.Plugins")
    'acme-search-plugins'
    """
    return re.sub(r"[-_.]+", "-", distribution).lower()


class PluginState(StrEnum):
    """Whether a plugin can be used; the same names as ``sketchmatch.v1.PluginState``."""

    ACTIVE = "ACTIVE"
    DISABLED = "DISABLED"
    FAILED = "FAILED"


@dataclass(frozen=True)
class PluginStatus:
    """What became of one plugin.

    Attributes
    ----------
    entry_point
        Its name in the distribution's entry points; empty where these cannot be read.
    distribution, version
        Where it comes from.
    state
        Whether it can be used.
    reason
        Why it is disabled or failed, or which of its names cannot be selected; else empty.
    """

    entry_point: str
    distribution: str
    version: str
    state: PluginState = PluginState.ACTIVE
    reason: str = ""

    @property
    def origin(self) -> str:
        """What it is and where it comes from, to begin a sentence with."""
        plugin = f"plugin {self.entry_point} of " if self.entry_point else "distribution "
        return f"{plugin}{self.distribution}"


@dataclass(frozen=True)
class PluginRules:
    """Which distributions may offer algorithms; the engine's own always may.

    Attributes
    ----------
    allow
        Their canonical names, or None for all. Use :meth:`of` for names as people write them.
    deny
        Canonical names of those that may not, even if ``allow`` has them.
    """

    allow: frozenset[str] | None = None
    deny: frozenset[str] = frozenset()

    @classmethod
    def of(cls, allow: Iterable[str] | None = None, deny: Iterable[str] = ()) -> Self:
        """Return rules for names of distributions, however they are written."""
        allowed = None if allow is None else frozenset(map(canonical, allow))
        return cls(allowed, frozenset(map(canonical, deny)))

    def objection(self, distribution: str) -> str:
        """Return why a distribution may offer nothing; empty if it may.

        Examples
        --------
        >>> PluginRules.of(deny=["Acme_Search"]).objection("acme-search")
        'the configuration denies it (plugins.deny)'
        """
        name = canonical(distribution)
        if name == OWN_DISTRIBUTION:
            return ""
        if name in self.deny:
            return "the configuration denies it (plugins.deny)"
        if self.allow is not None and name not in self.allow:
            return "the configuration does not allow it (plugins.allow)"
        return ""


EVERY_PLUGIN = PluginRules()
"""The rules that let in whatever is installed."""
