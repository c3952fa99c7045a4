"""Price and probabilities, learned from which of the maps that a match considers is right."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize

from sketchmatch.api import JudgeProblem
from sketchmatch.model import ConfidenceWeights, FloatArray, IntArray
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.judge import considered, problem_of
from sketchmatch.pipeline.request import alternatives_wanted
from sketchmatch.pipeline.search import Goal
from sketchmatch.pipeline.slices import finish
from sketchmatch.registry import default_registry
from sketchmatch_builtin.judges._odds import met
from sketchmatch_builtin.judges.calibration import Calibration
from tests.experiments.drawings import SHARE_WITH_EXTRAS, Drawing, drawing
from tests.experiments.logits import log_shares, significant
from tests.experiments.reliability import reliability

__all__ = ["Considered", "considered_by", "errors", "learned_odds"]

_MOST_OBJECTS = 16
_FITTED = ("price", "sharpness", "growth", "doubt", "reserve")
_SIMPLEXES = 4
_ENGINE = Engine(default_registry())

_Padded = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class Considered:
    """The maps that a match considers, the best first.

    Attributes
    ----------
    zeta, left_out
        Shape (k,): ζ, and the share of the template's objects that are left out.
    agree
        Shape (k, n): where each agrees with the best, which has n objects.
    truth
        Index of the right one; −1 where it is none of them.
    objects
        N.
    right
        Shape (n,): which objects of the best map are right.
    extra
        Whether the sketch shows what the map has not.
    """

    zeta: FloatArray
    left_out: FloatArray
    agree: FloatArray
    truth: int
    objects: int
    right: FloatArray
    extra: bool


def considered_by(weights: Any, price: float, part: str, number: int) -> list[Considered]:
    """Return what matches of a sketch consider, without objects unmatched and with."""
    drawn = drawing(part, number, _MOST_OBJECTS)
    return [] if drawn is None else [_considered(drawn, weights, p) for p in (None, price)]


def learned_odds(cases: list[Considered]) -> Calibration:
    """Return the calibration under which the truth is likeliest."""
    truths = np.array([each.truth for each in cases])
    rows, padded, counts = np.arange(len(cases)), _padded(cases), _counts(cases)

    def loss(fit: FloatArray) -> float:
        return -float(counts @ _log_odds(padded, fit)[rows, truths])

    found = np.array([0.2, 30.0, 1.0, 0.9, -5.0])
    exact = {"xatol": 1e-5, "fatol": 1e-9, "maxiter": 4000}
    for _ in range(_SIMPLEXES):
        found = minimize(loss, found, method="Nelder-Mead", options=exact).x
    lost = truths < 0
    rights = np.array([each.right.mean() for each in cases])
    luck = float(np.average(rights[lost], weights=counts[lost])) if lost.any() else 0.0
    price, sharpness, growth, doubt, reserve = (significant(each, 3) for each in found)
    return Calibration(price, sharpness, growth, doubt, reserve, significant(luck, 2))


def errors(cases: list[Considered], calibration: Calibration) -> dict[str, float]:
    """Return the expected calibration errors of maps and of objects."""
    fit = np.array([getattr(calibration, name) for name in _FITTED])
    shares = np.exp(_log_odds(_padded(cases), fit))
    maps = [(share, each.truth == 0) for share, each in zip(shares[:, 0], cases, strict=True)]
    objects = [
        pair
        for own, each in zip(shares, cases, strict=True)
        for pair in zip(
            own[: len(each.agree)] @ each.agree + calibration.luck * own[-1],
            each.right > 0,
            strict=True,
        )
    ]
    return {
        "maps": significant(reliability(maps).error, 2),
        "objects": significant(reliability(objects).error, 2),
    }


def _considered(drawing: Drawing, weights: Any, price: float | None) -> Considered:
    """Search, and return the maps that an answer would be chosen from."""
    pipeline = _ENGINE.resolve({})
    scenes, weights = (drawing.scene, drawing.map), ConfidenceWeights(*weights)
    work = _ENGINE.compare(scenes, pipeline.histogram, pipeline.similarity, weights)
    comparison = finish(work)
    price = math.inf if price is None else price
    goal = Goal(weights, price, alternatives_wanted(None, *scenes))
    found = finish(_ENGINE.search(comparison, pipeline.searcher, goal))
    first, others = finish(considered(comparison, found, goal))
    return _of(problem_of(comparison, first, others, goal), drawing)


def _of(problem: JudgeProblem, drawing: Drawing) -> Considered:
    """Return maps as numbers, beside the right one."""
    first, exchanges, omissions = problem.candidates[0], problem.exchanges, problem.omissions
    assert exchanges is not None
    truth = _turned(drawing.truth, len(drawing.map)) if problem.swapped else drawing.truth
    best = first.partners
    kept = np.flatnonzero(best >= 0)
    partners = best[kept]
    maps = {tuple(best.tolist()): first.confidence.total}
    for g, h in zip(*np.nonzero(np.isfinite(exchanges)), strict=True):
        changed = best.copy()
        changed[best == h] = partners[g]
        changed[kept[g]] = h
        maps[tuple(changed.tolist())] = exchanges[g, h]
    for g, confidence in enumerate(() if omissions is None else omissions):
        changed = best.copy()
        changed[kept[g]] = -1
        maps.setdefault(tuple(changed.tolist()), confidence)
    for other in met(problem):
        maps.setdefault(tuple(other.partners.tolist()), other.confidence.total)
    every = np.array(list(maps))
    right = np.flatnonzero((every == truth).all(axis=1))
    return Considered(
        np.array(list(maps.values())),
        (every < 0).mean(axis=1),
        (every[:, kept] == partners).astype(float),
        int(right[0]) if len(right) else -1,
        len(truth),
        (truth[kept] == partners).astype(float),
        bool((drawing.truth < 0).any()),
    )


def _turned(truth: IntArray, objects: int) -> IntArray:
    """Return the truth by map index."""
    turned = np.full(objects, -1)
    turned[truth[truth >= 0]] = np.flatnonzero(truth >= 0)
    return turned


def _counts(cases: list[Considered]) -> FloatArray:
    """Return what each case counts for, so that objects that the map lacks are as rare as in life.

    They sum to 1.
    """
    extra = np.array([each.extra for each in cases])
    counts = np.where(
        extra,
        SHARE_WITH_EXTRAS / max(1, extra.sum()),
        (1.0 - SHARE_WITH_EXTRAS) / max(1, (~extra).sum()),
    )
    return counts / counts.sum()


def _padded(cases: list[Considered]) -> _Padded:
    """Return ζ, −∞ where there is no map, shares left out, and N of all cases."""
    most = max(len(each.zeta) for each in cases)
    zeta, left_out = np.full((len(cases), most), -np.inf), np.zeros((len(cases), most))
    for k, each in enumerate(cases):
        zeta[k, : len(each.zeta)], left_out[k, : len(each.zeta)] = each.zeta, each.left_out
    return zeta, left_out, np.array([[float(each.objects)] for each in cases])


def _log_odds(padded: _Padded, fit: FloatArray) -> FloatArray:
    """Return the logarithm of how likely each map is, and last that it is none of them."""
    (zeta, left_out, objects), (price, sharpness, growth, doubt, reserve) = padded, fit
    steep = sharpness * objects**growth
    scores = np.concatenate([steep * (zeta - price * left_out), steep * doubt + reserve], axis=1)
    return log_shares(scores)
