"""Evidence beyond the thesis's: how alike objects are in shape and size, and how far apart.

How far apart the objects of a pair are says how far its rotation is to be trusted: where one of
them is drawn out of place, near ones turn about each other more.

How alike they are comes from the histograms of the constant force (r = 0) within each object,
whatever histogram describes the pairs: no other is defined for every object, and dilations follow
from it best.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

import numpy as np

from sketchmatch.api.forces import own_histograms
from sketchmatch.kernels.evidence import SelfRelations, weigh_entries
from sketchmatch.model import (
    DILATION_SCALE,
    ConfidenceWeights,
    FloatArray,
    RelationTable,
    Scene,
    object_pairs,
)
from sketchmatch.model.arrays import sealed
from sketchmatch.pipeline.relate import Histograms
from sketchmatch.pipeline.slices import in_slices

__all__ = ["compare_objects", "rotation_weights", "weigh_objects"]

# Of the mean distance; objects that surround each other may have one centroid.
_LEAST_DISTANCE = 0.01


def compare_objects(
    template: Scene, argument: Scene, directions: int
) -> Generator[float, None, SelfRelations]:
    """Compare every template object's own histogram with every argument object's.

    Parameters
    ----------
    template, argument
        The scenes.
    directions
        n, even, over the full turn.

    Yields
    ------
    float
        The share that is done.
    """
    drawn = yield from _own_histograms(template, directions, 0.0)
    mapped = yield from _own_histograms(argument, directions, 1.0 / 3.0)
    values, others = _units(drawn), _units(mapped)
    spectra, other_spectra = np.conj(np.fft.rfft(values)), np.fft.rfft(others)
    products = np.empty((len(values), *others.shape))

    def work(first: int, last: int) -> None:
        for a in range(first, last):
            products[a] = np.fft.irfft(spectra[a] * other_spectra, others.shape[1])

    for share in in_slices(len(values), work):
        yield (2.0 + share) / 3.0
    growth = (mapped.log_means - drawn.log_means[:, None]) / 3.0  # forces of exponent r: 3 − r
    return SelfRelations(
        products=sealed(products),
        roughness=sealed(drawn.roughness / drawn.squares),
        levels=sealed(DILATION_SCALE * growth),
    )


def weigh_objects(
    table: RelationTable, own: SelfRelations, weights: ConfidenceWeights
) -> Generator[float, None, RelationTable]:
    """Return the relations with evidence e = (w₁σ + w₄s + w₅m)/(w₁ + w₄ + w₅) for every entry.

    Parameters
    ----------
    table
        The relations.
    own
        How the objects compare.
    weights
        Of the parts of ζ.

    Yields
    ------
    float
        The share that is done.
    """
    evidence = np.empty((table.template_pairs, 2 * table.argument_pairs))
    pairs = object_pairs(table.template_objects), object_pairs(table.argument_objects)
    relations = table.similarity, table.rotation, table.dilation
    shares = np.array([weights.similarity, weights.shape, weights.size]) / weights.of_entries

    def work(first: int, last: int) -> None:
        weigh_entries(first, last, pairs, relations, own, shares, evidence)

    yield from in_slices(table.template_pairs, work)
    np.clip(evidence, 0.0, 1.0, out=evidence)
    return replace(table, evidence=sealed(evidence))


def rotation_weights(template: Scene, distance: float) -> FloatArray:
    """Return what the rotation of each pair of objects counts for: d^β, d apart by centroids.

    Parameters
    ----------
    template
        The scene, of at least two objects.
    distance
        β, 0 or more.

    Returns
    -------
    ndarray
        Shape (Q,), above 0; d is in units of its mean, and at least 0.01.

    Examples
    --------
    >>> square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    >>> scene = Scene.from_polygons([square, square + (2, 0), square + (6, 0)])
    >>> rotation_weights(scene, 1.0)
    array([0.5, 1.5, 1. ])
    """
    centroids = np.array([item.centroid for item in template.objects])
    a, b = object_pairs(len(template)).T
    distances = np.hypot(*(centroids[a] - centroids[b]).T)
    if not distances.any():
        return np.ones(len(a))
    weights: FloatArray = np.maximum(distances / distances.mean(), _LEAST_DISTANCE) ** distance
    return weights


def _own_histograms(
    scene: Scene, directions: int, done: float
) -> Generator[float, None, Histograms]:
    """Return F^aa of every object over half a turn, after which it repeats."""
    histograms = np.empty((len(scene), directions // 2))

    def work(first: int, last: int) -> None:
        histograms[first:last] = own_histograms(scene.objects[first:last], directions)

    for share in in_slices(len(scene), work):
        yield done + share / 3.0
    return Histograms.of(histograms)


def _units(histograms: Histograms) -> FloatArray:
    """Return the histograms in units of their norm."""
    return histograms.values / np.sqrt(histograms.squares)[:, None]
