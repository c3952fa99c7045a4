"""Describing and comparing relations in this process: what ``describe`` and ``relate`` show.

Imported by the commands when they run: numba and OpenCV come with it.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from sketchmatch.api import Algorithm, Histogram, Segmentation, Segmenter, Similarity
from sketchmatch.cli import display
from sketchmatch.cli.options import say
from sketchmatch.config import load, open_registry
from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io import read_source
from sketchmatch.model import FloatArray, Scene, SceneDescriptor, Source, object_pairs, pair_index
from sketchmatch.model.limits import limited_to
from sketchmatch.pipeline.describe import describe
from sketchmatch.pipeline.limits import check_comparisons, check_histograms
from sketchmatch.pipeline.plugins import blaming, segmented
from sketchmatch.pipeline.reading import half_turned
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.result import Correspondence
from sketchmatch.pipeline.selection import Choice, resolve, resolve_segmenter
from sketchmatch.pipeline.warmup import announcing_compilation
from sketchmatch.pipeline.words import DirectionalRelation, directional_relations
from sketchmatch.registry import Registry

__all__ = ["Comparison", "Description", "compared", "described"]

Pairs = Sequence[tuple[int, int]]
_Value = TypeVar("_Value")


@dataclass(frozen=True)
class Description:
    """The relations of some pairs of objects of one scene.

    Attributes
    ----------
    scene
        The objects.
    segmenter, histogram
        What found and described them.
    pairs
        (a, b), from 0.
    histograms
        Shape (m, n), of each pair.
    relations
        Each in words.
    directions
        Shape (m,), the main direction of each in radians within (−π, π].
    """

    scene: Scene
    segmenter: Segmenter
    histogram: Histogram
    pairs: Pairs
    histograms: FloatArray
    relations: tuple[DirectionalRelation, ...]
    directions: FloatArray


@dataclass(frozen=True)
class Comparison:
    """How pairs of a sketch compare with pairs of a map.

    Attributes
    ----------
    sketch, map
        The objects.
    histogram, similarity
        What described and compared them.
    best
        The most similar ones, best first.
    total
        How many there are.
    """

    sketch: Scene
    map: Scene
    histogram: Histogram
    similarity: Similarity
    best: tuple[Correspondence, ...]
    total: int


def described(
    file: Path,
    names: Mapping[str, str],
    params: Mapping[str, Any],
    pairs: Pairs,
    profile: str = "",
    config: Path | None = None,
) -> Description:
    """Describe pairs of the objects in a file, all pairs a < b if none are chosen.

    Raises
    ------
    InvalidInputError
        If the file, an algorithm, a parameter or a pair cannot be used.
    """
    configuration = load(config)
    registry, defaults = open_registry(configuration), configuration.defaults
    chosen = _choices(("segmenter", "histogram"), names, params)
    with limited_to(configuration.limits), announcing_compilation(say):
        source = read_source(file)
        segmenter = resolve_segmenter(registry, chosen["segmenter"], source, defaults, profile)
        selection = {"histogram": chosen["histogram"]}
        histogram = resolve(registry, selection, defaults=defaults, profile=profile).histogram
        scene = _found(registry, source, segmenter, "scene", "").scene
        _check_pairs(pairs, scene, "--pair", "scene")
        check_histograms("scene", scene, histogram)
        descriptor = _described(registry, scene, histogram, "", "describing relations")
    pairs = pairs or _all_pairs(scene)
    rows = _rows(descriptor, pairs)
    turns = np.exp(2j * np.pi * np.arange(rows.shape[1]) / rows.shape[1])
    return Description(
        scene,
        segmenter,
        histogram,
        pairs,
        rows,
        directional_relations(rows),
        np.angle(rows @ turns),
    )


def compared(
    sketch: Path,
    map_: Path,
    names: Mapping[str, str],
    params: Mapping[str, Any],
    sketch_pairs: Pairs,
    map_pairs: Pairs,
    limit: int,
    profile: str = "",
    config: Path | None = None,
) -> Comparison:
    """Compare pairs of a sketch with pairs of a map, all pairs a < b where none are chosen.

    They are compared as in a match: the scene with fewer objects is the template.

    Raises
    ------
    InvalidInputError
        If a file, an algorithm, a parameter or a pair cannot be used.
    """
    configuration = load(config)
    registry = open_registry(configuration)
    stages = ("sketch_segmenter", "map_segmenter", "histogram", "similarity")
    chosen = _choices(stages, names, params)
    with limited_to(configuration.limits), announcing_compilation(say):
        sources = (read_source(sketch), read_source(map_))
        pipeline = resolve(registry, chosen, *sources, configuration.defaults, profile)
        assert pipeline.sketch_segmenter is not None
        assert pipeline.map_segmenter is not None
        histogram, similarity = pipeline.histogram, pipeline.similarity
        drawn = _found(registry, sources[0], pipeline.sketch_segmenter, "sketch", "sketch").scene
        mapped = _found(registry, sources[1], pipeline.map_segmenter, "map", "map").scene
        _check_pairs(sketch_pairs, drawn, "--sketch-pair", "sketch")
        _check_pairs(map_pairs, mapped, "--map-pair", "map")
        for side, scene in (("sketch", drawn), ("map", mapped)):
            check_histograms(side, scene, histogram)
        check_comparisons(drawn, mapped)
        first = _described(registry, drawn, histogram, "sketch", "describing the sketch")
        second = _described(registry, mapped, histogram, "map", "describing the map")
        exchanged = len(drawn) > len(mapped)
        template, argument = (second, first) if exchanged else (first, second)
        work = relate(template, argument, similarity)
        table = _watched(registry, similarity, work, "comparing relations")
    values = [table.similarity, table.rotation, table.dilation]
    if exchanged:
        values = [table.similarity.T, -table.rotation.T, 1.0 / table.dilation.T]
    sketch_pairs, map_pairs = sketch_pairs or _all_pairs(drawn), map_pairs or _all_pairs(mapped)
    cells = np.ix_(_indices(sketch_pairs, len(drawn)), _indices(map_pairs, len(mapped)))
    sigma, rotation, dilation = (value[cells] for value in values)
    best = np.argsort(-sigma, axis=None, kind="stable")[:limit]
    entries = []
    for i, j in zip(*np.unravel_index(best, sigma.shape), strict=True):
        (a, b), (c, d) = sketch_pairs[i], map_pairs[j]
        dual = (a > b) != (c > d)
        turn = half_turned(float(rotation[i, j]) + (math.pi if dual else 0.0))
        entries.append(
            Correspondence((a, b), (c, d), float(sigma[i, j]), turn, float(dilation[i, j]))
        )
    return Comparison(drawn, mapped, histogram, similarity, tuple(entries), sigma.size)


def _choices(
    stages: Sequence[str], names: Mapping[str, str], params: Mapping[str, Any]
) -> dict[str, Choice]:
    return {stage: Choice(names.get(stage, ""), params.get(stage, {})) for stage in stages}


def _found(
    registry: Registry, source: Source, segmenter: Segmenter, field: str, side: str
) -> Segmentation:
    """Find the objects of a source and tell what was left out."""
    found = segmented(source, segmenter, registry, f"{field}.{source.field}")
    display.say_warnings(side, found.warnings)
    return found


def _described(
    registry: Registry, scene: Scene, histogram: Histogram, side: str, what: str
) -> SceneDescriptor:
    try:
        return _watched(registry, histogram, describe(scene, histogram), what)
    except InvalidInputError as error:
        raise error.within(side) from None


def _watched(
    registry: Registry, algorithm: Algorithm, work: Generator[float, None, _Value], what: str
) -> _Value:
    """Run an algorithm's stage to its end, showing how far it is."""
    with blaming(algorithm, registry):
        return display.follow(work, what)


def _check_pairs(pairs: Pairs, scene: Scene, option: str, what: str) -> None:
    for pair in pairs:
        for index in pair:
            if not 0 <= index < len(scene):
                raise InvalidInputError(
                    Reason.INVALID_FIELD,
                    option,
                    f"'{pair[0] + 1},{pair[1] + 1}' names object {index + 1}; "
                    f"the {what} has objects 1 … {len(scene)}, as `sketchmatch segment` shows them",
                )


def _all_pairs(scene: Scene) -> Pairs:
    return [(a, b) for a, b in object_pairs(len(scene)).tolist()]


def _rows(descriptor: SceneDescriptor, pairs: Pairs) -> FloatArray:
    """Return the histograms of pairs in either order, shape (m, n)."""
    rows = descriptor.histograms[_indices(pairs, descriptor.objects)]
    duals = np.array([a > b for a, b in pairs])
    rows[duals] = np.roll(rows[duals], descriptor.directions // 2, axis=1)
    return rows


def _indices(pairs: Pairs, objects: int) -> list[int]:
    return [pair_index(min(pair), max(pair), objects) for pair in pairs]
