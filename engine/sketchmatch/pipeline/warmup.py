"""Compiling kernels before they are needed, and saying so where it takes long."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from sketchmatch.kernels._jit import on_compile
from sketchmatch.model import Fmap, RelationTable, SceneDescriptor
from sketchmatch.pipeline.alternatives import exchange_confidences
from sketchmatch.pipeline.correspond import fmap_confidence, object_map, occm
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.selection import DEFAULTS, resolve
from sketchmatch.pipeline.slices import finish
from sketchmatch.registry import Kind, Registry

__all__ = ["COMPILING", "announcing_compilation", "warm_up", "warm_up_others"]

_log = logging.getLogger(__name__)

COMPILING = "compiling the kernels: this happens once after an installation and takes about 20 s"


@contextmanager
def announcing_compilation(say: Callable[[str], None]) -> Iterator[None]:
    """Call ``say`` with :data:`COMPILING`, once, if a kernel is not in the cache."""
    silent = True

    def listener(_: str) -> None:
        nonlocal silent
        if silent:
            silent = False
            say(COMPILING)

    with on_compile(listener):
        yield


def warm_up(registry: Registry, unwanted: Callable[[], bool] = lambda: False) -> None:
    """Load the kernels of the default pipeline, or compile them.

    Parameters
    ----------
    registry
        The algorithms.
    unwanted
        Asked before each algorithm; once it says so, the rest is left out.
    """
    pipeline = resolve(registry, {})
    table = _relate_one(pipeline.similarity)
    fmap = Fmap(np.array([0]))
    fmap_confidence(fmap, table)
    exchange_confidences(object_map(occm(fmap, table)), table, (1.0, 1.0, 1.0))
    _warm_up(registry, unwanted, default=True)


def warm_up_others(registry: Registry, unwanted: Callable[[], bool] = lambda: False) -> None:
    """Load or compile the kernels of the algorithms that :func:`warm_up` leaves out."""
    _warm_up(registry, unwanted, default=False)


def _relate_one(similarity: Any) -> RelationTable:
    """Compare one histogram with itself, which takes what aligns histograms for the measure."""
    one = SceneDescriptor(np.array([[1.0, 0.0, 0.0, 0.0]]), 2, 0.0)
    return finish(relate(one, one, similarity))


def _warm_up(registry: Registry, unwanted: Callable[[], bool], *, default: bool) -> None:
    for item in registry.algorithms:
        if (item.algorithm.name in DEFAULTS[item.kind]) is not default:
            continue
        if unwanted():
            return
        try:
            item.algorithm.warm_up()
            if item.kind is Kind.SIMILARITY:
                _relate_one(item.algorithm())
        except Exception:  # a plugin may raise anything; it will fail again when it is asked for
            _log.exception("%s failed to warm up", registry.whose(item.algorithm))
