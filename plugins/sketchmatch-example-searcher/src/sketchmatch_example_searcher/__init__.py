"""A plugin of sketchmatch: what a third party's distribution looks like."""

from __future__ import annotations

from sketchmatch.api import Searcher, hookimpl

__all__ = ["sketchmatch_api_version", "sketchmatch_register_searchers"]

sketchmatch_api_version = 1
"""The version of the plugin API that this is written for."""


@hookimpl
def sketchmatch_register_searchers() -> list[type[Searcher]]:
    """Offer the searcher; it is imported here so that listing other kinds costs nothing."""
    from sketchmatch_example_searcher.annealing import Annealing

    return [Annealing]
