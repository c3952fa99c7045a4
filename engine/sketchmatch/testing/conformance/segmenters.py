"""Contracts of segmenters."""

from __future__ import annotations

import math
import re
from collections.abc import Hashable, Iterator
from dataclasses import fields, replace
from functools import partial
from typing import Any, get_args

import numpy as np
import shapely

from sketchmatch.api import InvalidInputError, Segmentation, Segmenter
from sketchmatch.model import FloatArray, OccupancyGrid, PolygonSet, Scene, Source, StrokeSet
from sketchmatch.pipeline.guard import check_scene
from sketchmatch.testing.conformance.contract import (
    BrokenError,
    Contract,
    refused_as_broken,
    require,
)
from sketchmatch.testing.conformance.sources import (
    RESOLUTION,
    blank_sources,
    memory_of,
    sample_source,
)
from sketchmatch.testing.conformance.use import Use, contracts_of_use

__all__ = ["contracts"]

_LONGEST_SENTENCE = 500


def contracts(algorithm: type[Any]) -> tuple[Contract, ...]:
    """Return the contracts of a segmenter, which depend on the sources that it reads."""
    kinds = _kinds(algorithm)
    on_grids = _ON_GRIDS if OccupancyGrid in kinds else ()
    return (*_ON_ALL, *contracts_of_use(partial(_uses, kinds)), *on_grids)


def sources_are_known(algorithm: type[Any]) -> None:
    """Have a tuple ``sources`` of StrokeSet, PolygonSet, OccupancyGrid, Image, or subclasses."""
    sources = getattr(algorithm, "sources", None)
    require(isinstance(sources, tuple) and len(sources) > 0, f"sources is {sources!r}")
    for kind in sources or ():
        known = isinstance(kind, type) and issubclass(kind, get_args(Source))
        require(known, f"sources is {sources!r}")


def scenes_are_found(algorithm: type[Any]) -> None:
    """Return a Segmentation with a sound Scene, of a source of each type, and yield such cuts."""
    for source in _samples(algorithm):
        segmenter = algorithm()
        for found in (segmenter.segment(source), *segmenter.cuts(source)):
            fits = isinstance(found, Segmentation) and isinstance(found.scene, Scene)
            require(fits, f"of {source.field}, it returned a {type(found).__name__}")
            with refused_as_broken():
                check_scene(found.scene)
            if found.route is not None:
                shape = np.shape(found.route)
                require(len(shape) == 2 and shape[1] == 2, f"the route has shape {shape}")
            for pair in found.passages:
                a, b = pair
                fits = a != b and all(0 <= k < len(found.scene) for k in pair)
                require(fits, f"of {source.field}, a passage joins {pair}")


def warnings_are_sentences(algorithm: type[Any]) -> None:
    """Return a tuple of warnings, each one line that ends with a full stop."""
    for source in _samples(algorithm):
        warnings = algorithm().segment(source).warnings
        require(isinstance(warnings, tuple), f"the warnings are a {type(warnings).__name__}")
        for warning in warnings:
            fits = isinstance(warning, str) and re.fullmatch(r"\S.*\S\.", warning)
            require(fits, f"a warning is {warning!r}")


def blank_sources_are_refused(algorithm: type[Any]) -> None:
    """Refuse what has no two objects, in one sentence, with a path from the source's fields."""
    for kind in _kinds(algorithm):
        for what, source in blank_sources(kind).items():
            _refused(algorithm, what, source)


def y_points_up(algorithm: type[Any]) -> None:
    """Find what is in the upper half of a source in the upper half of its frame."""
    for source in _samples(algorithm):
        _, y0, _, y1 = algorithm().segment(source).scene.bounds
        low, high = _upper_half(source)
        slack = 0.1 * (high - low)
        require(
            low - slack <= y0 < y1 <= high + slack,
            f"objects of {source.field} with y from {low:.2f} to {high:.2f} are found from "
            f"{y0:.2f} to {y1:.2f}",
        )


def grids_are_in_the_frame_of_the_map(algorithm: type[Any]) -> None:
    """Move and turn the scene, in metres, with the grid's origin."""
    x, y, yaw = 30.0, -20.0, 0.5
    c, s = math.cos(yaw), math.sin(yaw)
    grid = _grid()
    there = algorithm().segment(replace(grid, origin=(x, y, yaw))).scene
    turn = np.array([[c, s], [-s, c]])
    _same(there, _outlines(algorithm().segment(grid).scene), turn, np.array([x, y]))


def resolution_scales_the_scene(algorithm: type[Any]) -> None:
    """Scale the scene with the size of the cells."""
    grid = _grid()
    factor = 1.05
    larger = algorithm().segment(replace(grid, resolution=factor * grid.resolution)).scene
    _same(larger, _outlines(algorithm().segment(grid).scene), factor * np.eye(2), np.zeros(2))


def _uses(kinds: tuple[type[Any], ...]) -> Iterator[Use]:
    for kind in kinds:
        for source in (sample_source(kind), sample_source(kind, mirrored=True)):
            given = f"a source of type {source.field}"
            yield Use(given, memory_of(source), partial(_found, source))


_ON_ALL: tuple[Contract, ...] = (
    sources_are_known,
    scenes_are_found,
    warnings_are_sentences,
    blank_sources_are_refused,
    y_points_up,
)
_ON_GRIDS: tuple[Contract, ...] = (
    grids_are_in_the_frame_of_the_map,
    resolution_scales_the_scene,
)


def _samples(algorithm: type[Any]) -> Iterator[Source]:
    return (sample_source(kind) for kind in _kinds(algorithm))


def _kinds(algorithm: type[Any]) -> tuple[type[Any], ...]:
    """Return the types of source of which there are samples: not those that a plugin made."""
    sources = getattr(algorithm, "sources", ())
    return tuple(kind for kind in sources if kind in get_args(Source))


def _grid() -> OccupancyGrid:
    grid = sample_source(OccupancyGrid)
    assert isinstance(grid, OccupancyGrid)
    return grid


def _refused(algorithm: type[Any], what: str, source: Source) -> None:
    try:
        found = algorithm().segment(source)
    except InvalidInputError as error:
        sentence = str(error)
        first = re.split(r"[.\[]", error.field)[0]
        known = {"", *(item.name for item in fields(source))}
        require(first in known, f"{what} is refused with the path {error.field!r}")
        fits = "\n" not in sentence and len(sentence) <= _LONGEST_SENTENCE
        require(fits, f"{what} is refused with {sentence!r}")
    except Exception as error:
        raise BrokenError(f"{what} made it raise {type(error).__name__}: {error}") from error
    else:
        raise BrokenError(f"in {what} it found {len(found.scene)} objects")


def _found(source: Source, segmenter: Segmenter) -> Hashable:
    objects = segmenter.segment(source).scene.objects
    return tuple(ring.tobytes() for item in objects for ring in item.rings)


def _upper_half(source: Source) -> tuple[float, float]:
    """Return the lowest and highest y at which the sample of a source has something."""
    if isinstance(source, StrokeSet | PolygonSet):
        y = np.concatenate([*memory_of(source).values()])[:, 1]
        return float(y.min()), float(y.max())
    rows = len(next(iter(memory_of(source).values()))) * (
        RESOLUTION if isinstance(source, OccupancyGrid) else 1.0
    )
    return rows / 2.0, rows


def _outlines(scene: Scene) -> list[FloatArray]:
    return [item.rings[0] for item in scene.objects]


def _same(scene: Scene, outlines: list[FloatArray], turn: FloatArray, step: FloatArray) -> None:
    """Require the outlines, turned and moved, in any order; they may be off by two cells."""
    require(len(scene) == len(outlines), f"it found {len(scene)} objects, and {len(outlines)}")
    expected = [shapely.LinearRing(ring @ turn + step) for ring in outlines]
    for found in _outlines(scene):
        off = min(shapely.hausdorff_distance(shapely.LinearRing(found), ring) for ring in expected)
        require(off <= 2.0 * RESOLUTION, f"an object is {off:.2f} m off")
