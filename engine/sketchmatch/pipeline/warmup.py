"""Compiling kernels before they are needed, and saying so where it takes long."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress

import numpy as np

from sketchmatch.api import Algorithm, Similarity
from sketchmatch.kernels._jit import on_compile
from sketchmatch.model import ConfidenceWeights, Fmap, RelationTable, Scene, SceneDescriptor
from sketchmatch.pipeline.alternatives import exchange_confidences
from sketchmatch.pipeline.correspond import (
    fmap_confidence,
    map_confidence,
    object_map,
    occm,
    own_confidence,
)
from sketchmatch.pipeline.evidence import compare_objects, weigh_objects
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.selection import UNCONFIGURED, Defaults, Pipeline, default_names
from sketchmatch.pipeline.slices import finish
from sketchmatch.pipeline.unmatched import Part, omission_confidences, part_of
from sketchmatch.pipeline.words import directional_relations
from sketchmatch.registry import Registered, Registry

__all__ = [
    "COMPILING",
    "announcing_compilation",
    "loading_kernels",
    "warm_up",
    "warm_up_others",
]

_log = logging.getLogger(__name__)

COMPILING = "compiling the kernels: this happens once after an installation and takes 15 to 60 s"


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


def loading_kernels(pipeline: Pipeline) -> Iterator[None]:
    """Load the kernels of a match, or compile them, yielding before each part of them.

    What was loaded once in this process is not loaded again.
    """
    for algorithm in (None, *map(type, pipeline.stages().values())):
        if algorithm not in _LOADED:
            yield
            with suppress(Exception):  # a plugin may raise anything, and be blamed when it is used
                _load(algorithm)


def warm_up(
    registry: Registry,
    defaults: Defaults = UNCONFIGURED,
    unwanted: Callable[[], bool] = lambda: False,
    warm: Callable[[Registered], None] = lambda _: None,
    *,
    backwards: bool = False,
) -> None:
    """Load the kernels of what requests use that choose nothing, or compile them.

    Parameters
    ----------
    registry
        The algorithms.
    defaults
        What the configuration chooses.
    unwanted
        Asked before each algorithm; once it says so, the rest is left out.
    warm
        Called with each algorithm whose kernels are there.
    backwards
        Whether to begin at the end, where another process begins at the beginning: each finds what
        the other has compiled.
    """
    algorithms = default_algorithms(registry, defaults)
    if backwards:
        _warm_up(reversed(algorithms), unwanted, warm)
        _load(None)
    else:
        _load(None)
        _warm_up(algorithms, unwanted, warm)


def warm_up_others(
    registry: Registry,
    defaults: Defaults = UNCONFIGURED,
    unwanted: Callable[[], bool] = lambda: False,
    warm: Callable[[Registered], None] = lambda _: None,
) -> None:
    """Load or compile the kernels of the algorithms that :func:`warm_up` leaves out."""
    chosen = default_algorithms(registry, defaults)
    _warm_up([item for item in registry.algorithms if item not in chosen], unwanted, warm)


def default_algorithms(registry: Registry, defaults: Defaults) -> list[Registered]:
    """Return the algorithms that requests use which choose nothing."""
    names = default_names(registry, defaults)
    return [item for item in registry.algorithms if item.name in names[item.kind]]


def _warm_up(
    algorithms: Iterable[Registered],
    unwanted: Callable[[], bool],
    warm: Callable[[Registered], None],
) -> None:
    for item in algorithms:
        if unwanted():
            return
        try:
            _load(item.algorithm)
        except Exception:  # a plugin may raise anything; it will fail again when it is asked for
            _log.exception("%s failed to warm up", item.origin)
        else:
            warm(item)


def _load(algorithm: type[Algorithm] | None) -> None:
    """Load what an algorithm needs; None stands for what every match needs."""
    if algorithm is None:
        _load_common()
    else:
        _load_algorithm(algorithm)
    _LOADED.add(algorithm)


_LOADED: set[type[Algorithm] | None] = set()


def _load_common() -> None:
    ones = np.ones((3, 3))
    table = RelationTable(ones, np.zeros((3, 3)), ones, 3, 3)
    fmap = Fmap(np.array([0, 1, 2]))
    fmap_confidence(fmap, table)
    exchange_confidences(object_map(occm(fmap, table)), table, (1.0, 1.0, 1.0))
    four = RelationTable(np.ones((6, 6)), np.zeros((6, 6)), np.ones((6, 6)), 4, 4)
    omission_confidences(Fmap.from_object_map(np.arange(4), 4), four, (1.0, 1.0, 1.0))
    corner = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    scene = Scene.from_polygons([corner, corner + 2.0, corner + 4.0])
    own = finish(compare_objects(scene, scene, 4))
    finish(weigh_objects(table, own, ConfidenceWeights(shape=1.0, size=1.0)))
    own_confidence(fmap, table, own)
    map_confidence(np.array([0, 1, -1]), table, own=own)
    part = finish(part_of(Part.whole(table, own), (0, 1)))
    assert part.own is not None
    own_confidence(Fmap(np.array([0])), part.table, part.own)
    directional_relations(np.ones((1, 4)))


def _load_algorithm(algorithm: type[Algorithm]) -> None:
    algorithm.warm_up()
    if issubclass(algorithm, Similarity):
        # With it comes what aligns histograms for the measure.
        one = SceneDescriptor(np.array([[1.0, 0.0, 0.0, 0.0]]), 2, 0.0)
        finish(relate(one, one, algorithm()))
