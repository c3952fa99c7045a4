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
        The searcher's name.
    options
        Further arguments of :func:`sketchmatch.match`.
    """

    name: str
    searcher: str
    options: Mapping[str, Any] = field(default_factory=dict)


_LEARNED = {"profile": "learned"}

METHODS: Mapping[str, Method] = MappingProxyType(
    {
        method.name: method
        for method in (
            Method("fsnn-pso", "fsnn-pso"),
            Method("fsnn-folded", "fsnn-pso", {"params": {"searcher": {"rotation": "folded"}}}),
            Method("easm", "easm"),
            Method("easm-pairwise", "easm", {"params": {"searcher": {"consistency": "pairwise"}}}),
            Method("auto", "auto"),
            Method("exact", "exact"),
            Method("direct", "direct"),
            Method("learned", "auto", _LEARNED),
            Method("unmatched", "auto", {**_LEARNED, "allow_unmatched": True}),
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
        searchers[METHODS[method].searcher].warm_up()
