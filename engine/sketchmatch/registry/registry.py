"""The algorithms at hand, by kind and name."""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from sketchmatch.api import Algorithm, Histogram, Searcher, Segmenter, Similarity
from sketchmatch.errors import InvalidInputError, Reason, quoted

__all__ = ["Kind", "PluginStatus", "Registered", "Registry"]


class Kind(StrEnum):
    """The four kinds of algorithm."""

    SEGMENTER = "segmenter"
    HISTOGRAM = "histogram"
    SIMILARITY = "similarity"
    SEARCHER = "searcher"

    @property
    def interface(self) -> type[Algorithm]:
        """The class that every algorithm of the kind derives from."""
        return _INTERFACES[self]

    @property
    def hook(self) -> str:
        """The hook that offers algorithms of the kind."""
        return f"sketchmatch_register_{_PLURALS[self]}"


_INTERFACES: dict[Kind, type[Algorithm]] = {
    Kind.SEGMENTER: Segmenter,
    Kind.HISTOGRAM: Histogram,
    Kind.SIMILARITY: Similarity,
    Kind.SEARCHER: Searcher,
}
_PLURALS = {
    Kind.SEGMENTER: "segmenters",
    Kind.HISTOGRAM: "histograms",
    Kind.SIMILARITY: "similarities",
    Kind.SEARCHER: "searchers",
}


@dataclass(frozen=True)
class Registered:
    """One algorithm and where it comes from."""

    kind: Kind
    algorithm: type[Algorithm]
    distribution: str
    version: str

    @property
    def name(self) -> str:
        """What it is selected by."""
        return self.algorithm.name

    @property
    def description(self) -> str:
        """The text of the class, with its source."""
        return inspect.getdoc(self.algorithm) or self.algorithm.summary

    @property
    def schema(self) -> dict[str, Any]:
        """JSON Schema of its parameters, with defaults, bounds and text."""
        return self.algorithm.Params.model_json_schema()


@dataclass(frozen=True)
class PluginStatus:
    """What became of one plugin.

    Attributes
    ----------
    entry_point
        Its name in the distribution's entry points.
    distribution, version
        Where it comes from.
    failure
        Why it could not be used, empty if it could.
    """

    entry_point: str
    distribution: str
    version: str
    failure: str = ""


class Registry:
    """The algorithms that can be selected.

    Parameters
    ----------
    algorithms
        All that were offered. Of two with the same kind and name neither can be selected.
    statuses
        What became of each plugin.
    """

    def __init__(
        self, algorithms: Iterable[Registered], statuses: Iterable[PluginStatus] = ()
    ) -> None:
        self.algorithms = tuple(algorithms)
        self.statuses = tuple(statuses)

    def of_kind(self, kind: Kind) -> tuple[Registered, ...]:
        """Return the algorithms of a kind, by name."""
        return tuple(
            sorted((item for item in self.algorithms if item.kind is kind), key=lambda i: i.name)
        )

    def whose(self, algorithm: Algorithm | type[Algorithm]) -> str:
        """Return an algorithm's kind, name and distribution, to begin a sentence with."""
        for item in self.algorithms:
            if item.algorithm in (algorithm, type(algorithm)):
                return f"{item.kind} {item.name} of {item.distribution} {item.version}".rstrip()
        return f"algorithm {algorithm.name}"

    def find(self, kind: Kind, name: str) -> Registered:
        """Return the algorithm that a name selects.

        Raises
        ------
        InvalidInputError
            If there is none, or more than one plugin offers it; its path is ``name``.
        """
        found = [item for item in self.of_kind(kind) if item.name == name]
        if len(found) == 1:
            return found[0]
        if not found:
            known = ", ".join(dict.fromkeys(item.name for item in self.of_kind(kind)))
            failed = "".join(
                f"; plugin {s.entry_point} of {s.distribution} failed to load: {s.failure}"
                for s in self.statuses
                if s.failure
            )
            raise InvalidInputError(
                Reason.UNKNOWN_ALGORITHM,
                "name",
                f"is {quoted(name)}, which is no {kind}; choose one of: {known or 'none'}{failed}",
            )
        owners = " and ".join(f"{item.distribution} {item.version}" for item in found)
        raise InvalidInputError(
            Reason.UNKNOWN_ALGORITHM,
            "name",
            f"is {name!r}, which both {owners} offer; uninstall one of them",
        )
