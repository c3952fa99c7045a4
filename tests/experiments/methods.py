"""What is compared: each method is a request that anybody can make."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from sketchmatch.pipeline import warmup
from sketchmatch.registry import Kind, default_registry

__all__ = ["METHODS", "THESIS", "Method", "warm_up"]


@dataclass(frozen=True)
class Method:
    """A name, and what the request says.

    Attributes
    ----------
    name
        What tables call it.
    searcher
        The searcher's name; None for the profile's, or the default.
    options
        Further arguments of :func:`sketchmatch.match`.
    """

    name: str
    searcher: str | None
    options: Mapping[str, Any] = field(default_factory=dict)


_THESIS = {"profile": "thesis"}


def _by_the_thesis(name: str, searcher: str, **parameters: str) -> Method:
    """Return a method that looks for the highest ζ of a map of all objects, as the thesis does."""
    options = {"params": {"searcher": parameters}} if parameters else {}
    return Method(name, searcher, {**_THESIS, **options})


METHODS: Mapping[str, Method] = MappingProxyType(
    {
        method.name: method
        for method in (
            _by_the_thesis("fsnn-pso", "fsnn-pso"),
            _by_the_thesis("fsnn-folded", "fsnn-pso", rotation="folded"),
            _by_the_thesis("easm", "easm"),
            _by_the_thesis("easm-pairwise", "easm", consistency="pairwise"),
            _by_the_thesis("auto", "auto"),
            _by_the_thesis("exact", "exact"),
            _by_the_thesis("direct", "direct"),
            Method("default", None),
        )
    }
)
"""The methods of the tables."""

THESIS = frozenset({"fsnn-pso", "fsnn-folded", "easm", "easm-pairwise"})
"""Those that the thesis has."""


def warm_up(methods: Iterable[str]) -> None:
    """Compile what methods need, so that no time measured includes it."""
    warmup.warm_up(default_registry())
    searchers = {item.name: item.algorithm for item in default_registry().of_kind(Kind.SEARCHER)}
    for method in methods:
        if (searcher := METHODS[method].searcher) is not None:
            searchers[searcher].warm_up()
