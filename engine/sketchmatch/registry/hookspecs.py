"""The hooks that a plugin can implement, each returning classes."""

from __future__ import annotations

import pluggy

from sketchmatch.api import Histogram, Judge, Reader, Searcher, Segmenter, Similarity

_hookspec = pluggy.HookspecMarker("sketchmatch")


@_hookspec
def sketchmatch_register_segmenters() -> list[type[Segmenter]]:  # type: ignore[empty-body]
    """Return segmenters."""


@_hookspec
def sketchmatch_register_histograms() -> list[type[Histogram]]:  # type: ignore[empty-body]
    """Return histograms."""


@_hookspec
def sketchmatch_register_similarities() -> list[type[Similarity]]:  # type: ignore[empty-body]
    """Return similarity measures."""


@_hookspec
def sketchmatch_register_searchers() -> list[type[Searcher]]:  # type: ignore[empty-body]
    """Return searchers."""


@_hookspec
def sketchmatch_register_judges() -> list[type[Judge]]:  # type: ignore[empty-body]
    """Return judges."""


@_hookspec
def sketchmatch_register_readers() -> list[type[Reader]]:  # type: ignore[empty-body]
    """Return readers of files."""
