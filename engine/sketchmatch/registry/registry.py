"""The algorithms at hand, by kind and name."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, get_args

from sketchmatch.api import Algorithm, Histogram, Judge, Searcher, Segmenter, Similarity
from sketchmatch.errors import InvalidInputError, PluginError, Reason, quoted
from sketchmatch.model import Source
from sketchmatch.registry.distributions import OWN_DISTRIBUTION, PluginState, PluginStatus
from sketchmatch.registry.readers import RegisteredReader

__all__ = ["Conflict", "Kind", "Registered", "Registry"]


class Kind(StrEnum):
    """The five kinds of algorithm."""

    SEGMENTER = "segmenter"
    HISTOGRAM = "histogram"
    SIMILARITY = "similarity"
    SEARCHER = "searcher"
    JUDGE = "judge"

    @property
    def interface(self) -> type[Algorithm]:
        """The class that every algorithm of the kind derives from."""
        return _INTERFACES[self]

    @property
    def plural(self) -> str:
        """The name of several of the kind."""
        return _PLURALS[self]

    @property
    def hook(self) -> str:
        """The hook that offers algorithms of the kind."""
        return f"sketchmatch_register_{self.plural}"


_INTERFACES: dict[Kind, type[Algorithm]] = {
    Kind.SEGMENTER: Segmenter,
    Kind.HISTOGRAM: Histogram,
    Kind.SIMILARITY: Similarity,
    Kind.SEARCHER: Searcher,
    Kind.JUDGE: Judge,
}
_PLURALS = {
    Kind.SEGMENTER: "segmenters",
    Kind.HISTOGRAM: "histograms",
    Kind.SIMILARITY: "similarities",
    Kind.SEARCHER: "searchers",
    Kind.JUDGE: "judges",
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
    def origin(self) -> str:
        """What it is and where it comes from, to begin a sentence with."""
        return f"{self.kind} {self.name} of {self.distribution} {self.version}".rstrip()

    @property
    def description(self) -> str:
        """The text of the class, with its source."""
        return inspect.cleandoc(self.algorithm.__doc__ or self.algorithm.summary)

    @property
    def source(self) -> str:
        """The publications that it is from: the section References of its text, in one line."""
        _, _, after = self.description.partition("\nReferences\n----------\n")
        section = re.split(r"\n\S[^\n]*\n-{3,}\n", after)[0]
        return " ".join(section.replace(".. ", "").split())

    def reads(self, source: type[Any]) -> bool:
        """Whether it is a segmenter for sources of a type."""
        return issubclass(self.algorithm, Segmenter) and issubclass(source, self.algorithm.sources)

    @property
    def schema(self) -> dict[str, Any]:
        """JSON Schema of its parameters, with defaults, bounds and text."""
        return self.algorithm.Params.model_json_schema()


@dataclass(frozen=True)
class Conflict:
    """A name that several distributions offer an algorithm of one kind under.

    Attributes
    ----------
    kind, name
        What is offered.
    owners
        Each distribution with its version.
    taken
        The engine's own distribution if it is among them, whose algorithm the name selects;
        otherwise empty, and the name selects nothing.
    """

    kind: Kind
    name: str
    owners: tuple[str, ...]
    taken: str = ""

    def __str__(self) -> str:
        effect = f"that of {self.taken} is used" if self.taken else "neither is used"
        return f"{self.kind} {self.name!r} {self.offered}: {effect}; {_REMEDY}"

    @property
    def offered(self) -> str:
        """Who offers it, to follow its name."""
        return f"is offered by {' and '.join(self.owners)}"


_REMEDY = "uninstall one of them or put it into plugins.deny"


class Registry:
    """The algorithms that can be selected.

    Parameters
    ----------
    algorithms
        All that were offered. Of several with the same kind and name, that of the engine's own
        distribution is selected, and otherwise none.
    statuses
        What became of each plugin.
    readers
        The readers of files that were offered.

    Attributes
    ----------
    algorithms
        All that a name selects.
    readers
        The readers of files, by name.
    conflicts
        The names that several distributions offer.
    statuses
        What became of each plugin, and of its names.
    """

    def __init__(
        self,
        algorithms: Iterable[Registered],
        statuses: Iterable[PluginStatus] = (),
        readers: Iterable[RegisteredReader] = (),
    ) -> None:
        self.readers = tuple(sorted(readers, key=lambda item: (item.name, item.distribution)))
        offered: dict[tuple[Kind, str], list[Registered]] = {}
        for item in algorithms:
            offered.setdefault((item.kind, item.name), []).append(item)
        self.algorithms = tuple(item for items in offered.values() for item in _selectable(items))
        self._of_kind = {
            kind: tuple(
                sorted((a for a in self.algorithms if a.kind is kind), key=lambda a: a.name)
            )
            for kind in Kind
        }
        ours = (item for item in self.algorithms if item.distribution == OWN_DISTRIBUTION)
        self._own = frozenset(item.algorithm for item in ours)
        self.conflicts = tuple(_conflict(items) for items in offered.values() if len(items) > 1)
        self.statuses = tuple(self._with_conflicts(status) for status in statuses)

    def of_kind(self, kind: Kind) -> tuple[Registered, ...]:
        """Return the algorithms of a kind, by name."""
        return self._of_kind[kind]

    def whose(self, algorithm: Algorithm | type[Algorithm]) -> str:
        """Return an algorithm's kind, name and distribution, to begin a sentence with."""
        for item in self.algorithms:
            if item.algorithm in (algorithm, type(algorithm)):
                return item.origin
        return f"algorithm {algorithm.name}"

    def is_own(self, algorithm: Algorithm) -> bool:
        """Whether an algorithm is the engine's own."""
        return type(algorithm) in self._own

    @property
    def problems(self) -> tuple[str, ...]:
        """A sentence for each plugin that failed and each name in conflict."""
        failed = (
            f"{status.origin} {status.version} failed to load: {status.reason}"
            for status in self.statuses
            if status.state is PluginState.FAILED
        )
        return (*failed, *map(str, self.conflicts))

    def refuse_problems(self) -> None:
        """Accept no plugin that failed and no name in conflict.

        Raises
        ------
        PluginError
            If there is one, with the first of them and how many there are.
        """
        if self.problems:
            first, *others = self.problems
            more = f" (and {len(others)} more)" if others else ""
            raise PluginError(f"{first}{more}; correct it, or set plugins.strict to false")

    def without(self, *distributions: str) -> Registry:
        """Return a registry that leaves out what some distributions offer."""
        return Registry(
            (item for item in self.algorithms if item.distribution not in distributions),
            (status for status in self.statuses if status.distribution not in distributions),
            (item for item in self.readers if item.distribution not in distributions),
        )

    def find(self, kind: Kind, name: str) -> Registered:
        """Return the algorithm that a name selects.

        Raises
        ------
        InvalidInputError
            If there is none, or more than one plugin offers it; its path is ``name``.
        """
        for item in self.of_kind(kind):
            if item.name == name:
                return item
        for conflict in self.conflicts:
            if (conflict.kind, conflict.name) == (kind, name):
                problem = f"is {name!r}, which {conflict.offered}; {_REMEDY}"
                raise InvalidInputError(Reason.UNKNOWN_ALGORITHM, "name", problem)
        problem = f"is {quoted(name)}, which is not a {kind}; {self._known(kind)}"
        raise InvalidInputError(Reason.UNKNOWN_ALGORITHM, "name", problem)

    def default(self, kind: Kind, source: type[Any] | None = None) -> str:
        """Return the name of what is used where nobody chooses; empty if there is nothing.

        Parameters
        ----------
        kind
            The kind of algorithm.
        source
            For a segmenter, the type of source that it shall read. A plugin's own type goes to
            the one segmenter that names it, if there is just one.
        """
        naming = [
            item
            for item in self.of_kind(kind)
            if source is not None
            and source not in get_args(Source)
            and issubclass(item.algorithm, Segmenter)
            and source in item.algorithm.sources
        ]
        if len(naming) == 1:
            return naming[0].name
        for item in self.of_kind(kind):
            ours = item.distribution == OWN_DISTRIBUTION and vars(item.algorithm).get("default")
            if ours and (source is None or item.reads(source)):
                return item.name
        return ""

    def _with_conflicts(self, status: PluginStatus) -> PluginStatus:
        """Return a status that tells which names of the plugin cannot be selected."""
        origin = f"{status.distribution} {status.version}".rstrip()
        lost = [
            str(conflict)
            for conflict in self.conflicts
            if origin in conflict.owners and status.distribution != conflict.taken
        ]
        return replace(status, reason="; ".join(lost)) if lost else status

    def _known(self, kind: Kind) -> str:
        """Say which plugins might have offered more, and what can be chosen."""
        missing = "".join(
            f"{status.origin} {_MISSING[status.state]}: {status.reason}; "
            for status in self.statuses
            if status.state is not PluginState.ACTIVE
        )
        known = ", ".join(item.name for item in self.of_kind(kind)) or "none"
        return f"{missing}choose one of: {known}"


_MISSING = {PluginState.FAILED: "failed to load", PluginState.DISABLED: "is disabled"}


def _selectable(items: Sequence[Registered]) -> Sequence[Registered]:
    """Return which of the algorithms with one kind and name the name selects, if any."""
    own = [item for item in items if item.distribution == OWN_DISTRIBUTION]
    return items if len(items) == 1 else own


def _conflict(items: Sequence[Registered]) -> Conflict:
    owners = tuple(f"{item.distribution} {item.version}".rstrip() for item in items)
    own = any(item.distribution == OWN_DISTRIBUTION for item in items)
    return Conflict(items[0].kind, items[0].name, owners, OWN_DISTRIBUTION if own else "")
