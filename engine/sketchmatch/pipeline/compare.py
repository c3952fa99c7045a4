"""A sketch compared with a map: the middle of a match, from which every search begins."""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from sketchmatch.api import Histogram, Similarity
from sketchmatch.errors import InvalidInputError, Reason, counted
from sketchmatch.kernels.evidence import SelfRelations
from sketchmatch.model import (
    ConfidenceWeights,
    Pairs,
    RelationTable,
    Scene,
    SceneDescriptor,
    object_pairs,
    pair_count,
    pair_index,
)
from sketchmatch.model.text import Table, Tabular, name
from sketchmatch.pipeline.describe import check_histograms
from sketchmatch.pipeline.evidence import compare_objects, rotation_weights, weigh_objects
from sketchmatch.pipeline.guard import blamed
from sketchmatch.pipeline.memory import Memory
from sketchmatch.pipeline.reading import half_turned
from sketchmatch.pipeline.relate import relate
from sketchmatch.pipeline.result import Correspondence
from sketchmatch.pipeline.selection import SIDES
from sketchmatch.pipeline.slices import retold
from sketchmatch.registry import Registry

__all__ = ["Comparison", "check_scenes", "compare", "is_swapped"]

# What 2 GB hold: 100 × 100 objects.
_MAX_COMPARISONS = 30_000_000

_Value = TypeVar("_Value")


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Tabular):
    """How the relations within a sketch compare with those on a map.

    The scene with fewer objects, or else the sketch, is the template of the table, the other one
    the argument.

    Attributes
    ----------
    sketch, map
        The scenes.
    sketch_descriptor, map_descriptor
        Their histograms.
    table
        How every pair of the template compares with every pair of the argument.
    own
        How the objects themselves compare; None where shapes and sizes have no weight.
    """

    sketch: Scene
    map: Scene
    sketch_descriptor: SceneDescriptor
    map_descriptor: SceneDescriptor
    table: RelationTable
    own: SelfRelations | None = None

    @property
    def swapped(self) -> bool:
        """Whether the template is the map: it has fewer objects than the sketch."""
        return is_swapped(self.sketch, self.map)

    @property
    def scenes(self) -> tuple[Scene, Scene]:
        """The template and the argument."""
        return (self.map, self.sketch) if self.swapped else (self.sketch, self.map)

    def most_similar(
        self, sketch_pairs: Pairs = (), map_pairs: Pairs = (), limit: int | None = None
    ) -> tuple[Correspondence, ...]:
        """Compare pairs of sketched objects with pairs of mapped ones, the highest σ first.

        Parameters
        ----------
        sketch_pairs, map_pairs
            Ordered pairs of indices, from 0; by default all pairs (a, b), a < b.
        limit
            Largest number; None for all.
        """
        table = self.table
        values = [table.similarity, table.rotation, table.dilation]
        if self.swapped:
            values = [table.similarity.T, -table.rotation.T, 1.0 / table.dilation.T]
        sketch_pairs = sketch_pairs or _all_pairs(self.sketch)
        map_pairs = map_pairs or _all_pairs(self.map)
        cells = np.ix_(_rows(sketch_pairs, self.sketch), _rows(map_pairs, self.map))
        sigma, rotation, dilation = (value[cells] for value in values)
        best = np.argsort(-sigma, axis=None, kind="stable")[:limit]
        found = []
        for i, j in zip(*np.unravel_index(best, sigma.shape), strict=True):
            (a, b), (c, d) = sketch_pairs[i], map_pairs[j]
            turn = float(rotation[i, j]) + (math.pi if (a > b) != (c > d) else 0.0)
            found.append(
                Correspondence(
                    (a, b),
                    (c, d),
                    float(sigma[i, j]),
                    half_turned(turn),
                    float(dilation[i, j]),
                )
            )
        return tuple(found)

    def _headline(self) -> str:
        return (
            f"{counted(self.table.similarity.size, 'pair')} of relations, "
            f"{len(self.sketch)} sketched objects with {len(self.map)} mapped ones, "
            f"similarity up to {self.table.similarity.max():.3f}"
        )

    def _table(self) -> Table:
        heads = ("in the sketch", "on the map", "similarity", "degrees", "dilation")
        rows = [
            (
                _names(entry.sketch_pair, self.sketch),
                _names(entry.map_pair, self.map),
                f"{entry.similarity:.3f}",
                f"{math.degrees(entry.rotation):.1f}",
                f"{entry.dilation:.3g}",
            )
            for entry in self.most_similar(limit=10)
        ]
        return Table(f"{self._headline()}; the most similar:", heads, rows, 2)


def _check_comparisons(sketch: Scene, map_: Scene) -> None:
    """Refuse two scenes whose relation table would not fit into memory.

    Raises
    ------
    InvalidInputError
        With the path ``sketch``.
    """
    comparisons = pair_count(len(sketch)) * pair_count(len(map_))
    if comparisons > _MAX_COMPARISONS:
        raise InvalidInputError(
            Reason.LIMIT_EXCEEDED,
            "sketch",
            f"has {len(sketch)} objects and the map has {len(map_)}, which makes {comparisons} "
            f"comparisons of relations, more than the limit of {_MAX_COMPARISONS}; "
            "leave out small objects",
        )


def check_scenes(scenes: tuple[Scene, Scene], histogram: Histogram) -> None:
    """Refuse a sketch and a map whose histograms or comparison would not fit into memory.

    Raises
    ------
    InvalidInputError
        With the path ``sketch`` or ``map``.
    """
    for side, scene in zip(SIDES, scenes, strict=True):
        check_histograms(side, scene, histogram)
    _check_comparisons(*scenes)


def compare(
    scenes: tuple[Scene, Scene],
    descriptors: tuple[SceneDescriptor, SceneDescriptor],
    similarity: Similarity,
    registry: Registry,
    weights: ConfidenceWeights = ConfidenceWeights(),  # noqa: B008
    memory: Memory | None = None,
) -> Generator[float, None, Comparison]:
    """Compare a sketch with a map, objects too where these have weight.

    Parameters
    ----------
    scenes, descriptors
        Of the sketch and of the map, which :func:`check_scenes` lets pass, described by the same
        histogram.
    similarity
        How alike two histograms are.
    registry
        Where the measure comes from, to blame it by name.
    weights
        Of ζ: what objects count for, and distance, are part of the table.
    memory
        Which relations need not be computed again; None where nothing is remembered.

    Yields
    ------
    float
        The share that is done.

    Raises
    ------
    InvalidInputError
        If no dilation follows from the histograms, or they are different ones.
    PluginError
        If the measure breaks its contract.
    """
    (template, argument), related = scenes, descriptors
    if is_swapped(*scenes):
        (argument, template), related = scenes, (descriptors[1], descriptors[0])
    share = 0.4 if weights.of_objects else 1.0
    known = None if memory is None else memory.rows(*related, similarity)
    work = blamed(relate(*related, similarity, known), similarity, registry)
    table = yield from _part(work, 0.0, share)
    if memory is not None:
        memory.keep_rows(*related, similarity, table)
    if weights.distance:
        table = replace(table, rotation_weights=rotation_weights(template, weights.distance))
    own = None
    if weights.of_objects:
        comparing = compare_objects(template, argument, descriptors[0].directions)
        own = yield from _part(comparing, 0.4, 0.5)
        table = yield from _part(weigh_objects(table, own, weights), 0.5, 1.0)
    return Comparison(*scenes, *descriptors, table, own)


def is_swapped(sketch: Scene, map_: Scene) -> bool:
    """Whether the template is the map: it has fewer objects than the sketch."""
    return len(sketch) > len(map_)


def _part(
    work: Generator[float, None, _Value], begin: float, end: float
) -> Generator[float, None, _Value]:
    """Go on with work that is a part of more, telling shares of the whole."""
    return retold(work, lambda share: (begin + (end - begin) * share,))


def _names(pair: tuple[int, int], scene: Scene) -> str:
    return ", ".join(name(k, scene.labels[k]) for k in pair)


def _all_pairs(scene: Scene) -> Pairs:
    return [(a, b) for a, b in object_pairs(len(scene)).tolist()]


def _rows(pairs: Pairs, scene: Scene) -> list[int]:
    return [pair_index(min(pair), max(pair), len(scene)) for pair in pairs]
