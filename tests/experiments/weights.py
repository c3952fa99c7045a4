"""Weights of ζ, learned from sketches without one object by a conditional logit over all maps."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from scipy.optimize import minimize

from sketchmatch.kernels._jit import kernel
from sketchmatch.kernels.confidence import fmap_confidence, fmap_confidence_above
from sketchmatch.kernels.evidence import mean_parts
from sketchmatch.model import (
    BoolArray,
    ConfidenceWeights,
    FloatArray,
    IntArray,
    correspondences,
    object_pairs,
)
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.evidence import rotation_weights
from sketchmatch.pipeline.slices import finish
from sketchmatch.registry import default_registry
from sketchmatch_builtin.histograms.constant import ConstantForce
from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation
from tests.experiments.drawings import drawing
from tests.experiments.logits import log_shares, significant

__all__ = ["COMPARED", "DISTANCES", "FOLDS", "Held", "Parts", "learned_weights", "parts_of"]

DISTANCES = (0.0, 0.5, 1.0, 1.5, 2.0)
"""Exponents of distance that are compared."""

COMPARED = {"relations": 3, "relations, shapes and sizes": 5}
"""How many parts of ζ may have weight: ζσ, ζR and ζL, and ζS and ζM."""

FOLDS = 5

_PENALTIES = (2e-8, 5e-8, 1e-7, 2e-7, 5e-7, 1e-6)
_MOST_OBJECTS = 8
_KEPT = 25
_FIRST_GUESSES = ([1, 1, 1, 0, 0], [1, 2, 0.4, 0.6, 0.9], [1, 1, 1, 1, 1], [0, 1, 1, 1, 0])

# No part of the thesis's ζ is silent: maps may differ in nothing else.
_LEAST_WEIGHT = 0.05


@dataclass(frozen=True)
class Held:
    """What cross-validation says of weights that are fitted to the other folds.

    Attributes
    ----------
    compared, distance
        Which parts may have weight, and the exponent of distance.
    penalty
        What the fit pays for the square of a coefficient.
    loss, error
        Mean of −ln of the probability of the right map, and its standard error.
    right
        Share of sketches whose best map is right.
    """

    compared: str
    distance: float
    penalty: float
    loss: float
    error: float
    right: float


@dataclass(frozen=True, eq=False)
class Parts:
    """The parts of ζ of the best maps of a sketch under several weights.

    Attributes
    ----------
    alike, turned
        Shapes (k, 4) and (k, d): ζσ, ζL, ζS and ζM; and ζR for each of the d exponents.
    right
        Index of the right map.
    """

    alike: FloatArray
    turned: FloatArray
    right: int

    def at(self, distance: float, count: int) -> FloatArray:
        """Return the first of ζσ, ζR, ζL, ζS and ζM with an exponent of distance."""
        turned = self.turned[:, DISTANCES.index(distance)]
        return np.column_stack([self.alike[:, 0], turned, self.alike[:, 1:]])[:, :count]


def parts_of(number: int) -> list[Parts]:
    """Return the parts of ζ of a sketch without one object; none where segmentation failed."""
    drawn = drawing("weights", number, _MOST_OBJECTS, missing=1, extra=0)
    if drawn is None:
        return []
    engine = Engine(default_registry())
    scenes, both = (drawn.scene, drawn.map), ConfidenceWeights(shape=1.0, size=1.0)
    compared = finish(engine.compare(scenes, ConstantForce(), CrossCorrelation(), both))
    table, own = replace(compared.table, evidence=None), compared.own
    assert own is not None
    maps = _all_maps(len(drawn.scene), len(drawn.map))
    alike, turned = np.empty((len(maps), 4)), np.empty((len(maps), len(DISTANCES)))
    pairs = object_pairs(len(drawn.scene)), object_pairs(len(drawn.map))
    relations = table.similarity, table.cosine, table.sine, table.normalized_dilation
    tables = [replace(table, rotation_weights=rotation_weights(drawn.scene, d)) for d in DISTANCES]
    weighed = np.stack([each.cosine for each in tables]), np.stack([each.sine for each in tables])
    columns = correspondences(len(drawn.map))
    turns = table.rotation, table.dilation
    _weigh(maps, pairs, columns, relations, weighed, turns, own, alike, turned)
    right = int(np.flatnonzero((maps == drawn.truth).all(axis=1))[0])
    kept, every = {right}, Parts(alike, turned, right)
    for weights, distance in itertools.product(_FIRST_GUESSES, DISTANCES):
        scores = every.at(distance, 5) @ np.array(weights)
        kept |= set(np.argsort(-scores)[:_KEPT].tolist())
    order = sorted(kept)
    return [Parts(alike[order], turned[order], order.index(right))]


def learned_weights(cases: list[Parts]) -> tuple[list[Held], tuple[float, ...]]:
    """Compare what may have weight, and return the weights of what predicts best.

    Of that, the strongest penalty is taken whose loss is within a standard error of the least
    (L. Breiman et al., "Classification and regression trees", 1984, 3.4.3): evidence that is worth
    much on simulated sketches alone gets no more weight than it takes.

    Returns
    -------
    list of Held
        What cross-validation says; the last is what was chosen.
    tuple of float
        The weights, fitted to all cases: of ζσ, which is 1, ζR, ζL, ζS and ζM, and β.
    """
    held = [
        _held(cases, name, distance, 0.0)
        for name, distance in itertools.product(COMPARED, DISTANCES)
    ]
    best = min(held, key=lambda each: each.loss)
    calmer = [_held(cases, best.compared, best.distance, penalty) for penalty in _PENALTIES]
    enough = best.loss + best.error
    chosen = max((best, *calmer), key=lambda each: (each.loss <= enough, each.penalty))
    found = np.zeros(5)
    fitted = _logit(cases, chosen.compared, chosen.distance).fitted(chosen.penalty)
    found[: len(fitted)] = fitted / fitted[0]
    found[:3] = np.maximum(found[:3], _LEAST_WEIGHT)
    weights = (*(significant(each, 2) for each in found), chosen.distance)
    return [*held, *(each for each in calmer if each is not chosen), chosen], weights


@dataclass(frozen=True, eq=False)
class _Logit:
    """A conditional logit.

    Attributes
    ----------
    parts
        Shape (cases, k, parts): those of k maps of each case, or of fewer.
    none
        bool, shape (cases, k): where there is no map.
    right
        Shape (cases,): which map is right.
    """

    parts: FloatArray
    none: BoolArray
    right: IntArray

    @classmethod
    def of(cls, cases: list[FloatArray], right: list[int]) -> _Logit:
        most = max(len(each) for each in cases)
        parts = np.zeros((len(cases), most, cases[0].shape[1]))
        none = np.ones((len(cases), most), dtype=bool)
        for k, own in enumerate(cases):
            parts[k, : len(own)], none[k, : len(own)] = own, False
        return cls(parts, none, np.array(right))

    def part(self, which: Any) -> _Logit:
        return _Logit(self.parts[which], self.none[which], self.right[which])

    def fitted(self, penalty: float) -> FloatArray:
        """Return the weights, 0 or more, under which the right maps are likeliest."""
        rows = np.arange(len(self.right))

        def loss(weights: FloatArray) -> tuple[float, FloatArray]:
            shares = self._log_shares(weights)
            expected = np.einsum("km,kmp->p", np.exp(shares), self.parts)
            slope = expected - self.parts[rows, self.right].sum(axis=0)
            value = penalty * weights @ weights - shares[rows, self.right].mean()
            return float(value), slope / len(rows) + 2.0 * penalty * weights

        start = np.full(self.parts.shape[2], 60.0)
        bounds = [(0.0, None)] * len(start)
        found: FloatArray = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds).x
        return found

    def tried(self, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return −ln of the probabilities of the right maps, and which of them are the best."""
        shares = self._log_shares(weights)
        return -shares[np.arange(len(self.right)), self.right], shares.argmax(axis=1) == self.right

    def _log_shares(self, weights: FloatArray) -> FloatArray:
        return log_shares(np.where(self.none, -np.inf, self.parts @ weights))


def _held(cases: list[Parts], compared: str, distance: float, penalty: float) -> Held:
    """Fit to all folds but one, try that one, and so on."""
    logit, fold = _logit(cases, compared, distance), np.arange(len(cases)) % FOLDS
    losses, rights = np.empty(len(cases)), np.empty(len(cases))
    for k in range(FOLDS):
        fitted = logit.part(fold != k).fitted(penalty)
        losses[fold == k], rights[fold == k] = logit.part(fold == k).tried(fitted)
    loss, error = float(losses.mean()), float(losses.std() / math.sqrt(len(cases)))
    return Held(compared, distance, penalty, loss, error, float(rights.mean()))


def _logit(cases: list[Parts], compared: str, distance: float) -> _Logit:
    parts = [each.at(distance, COMPARED[compared]) for each in cases]
    return _Logit.of(parts, [each.right for each in cases])


@kernel
def _weigh(
    maps: Any,
    pairs: Any,
    columns: Any,
    relations: Any,
    weighed: Any,
    turns: Any,
    own: Any,
    alike: Any,
    turned: Any,
) -> None:
    """Write ζσ, ζL, ζS and ζM of the FMAP of each object map, and ζR by exponents of distance."""
    template, ones = pairs[0], np.ones(3)
    similarity, cosine, sine, level = relations
    cosines, sines = weighed
    entries, scratch = np.empty(len(template), dtype=np.int64), np.empty(len(template))
    for k in range(len(maps)):
        for i in range(len(template)):
            entries[i] = columns[maps[k, template[i, 0]], maps[k, template[i, 1]]]
        found = fmap_confidence(entries, scratch, similarity, cosine, sine, level, ones)
        alike[k, 0], alike[k, 1] = found[1], found[3]
        alike[k, 2], alike[k, 3] = mean_parts(entries, pairs, turns[0], turns[1], own)
        for d in range(len(cosines)):
            # Above infinity there is no ζ, so ζL, which takes longest, is left out.
            turned[k, d] = fmap_confidence_above(
                np.inf, entries, scratch, similarity, cosines[d], sines[d], level, ones
            )[2]


@cache
def _all_maps(objects: int, others: int) -> IntArray:
    return np.array(list(itertools.permutations(range(others), objects)))
