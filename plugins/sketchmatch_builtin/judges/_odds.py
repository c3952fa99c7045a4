"""How likely an answer is right: a conditional logit over the maps that come close to it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sketchmatch.api import Candidate, JudgedMap, Judgement, JudgeProblem
from sketchmatch.model import FloatArray, IntArray
from sketchmatch_builtin.judges.calibration import Calibration

__all__ = ["likelihood", "met"]


def met(problem: JudgeProblem) -> tuple[Candidate, ...]:
    """Return the candidates that count beside the first, what is worth most first.

    Of those that match the same objects as the first, these are as many as the caller wants to
    see; each of the others is the best of its objects.
    """
    first, *others = problem.candidates
    alike = [_matched(first.partners) == _matched(other.partners) for other in others]
    wanted = np.cumsum(alike) <= problem.alternatives
    return tuple(
        other
        for other, is_alike, is_wanted in zip(others, alike, wanted, strict=True)
        if is_wanted or not is_alike
    )


def likelihood(
    problem: JudgeProblem, others: Sequence[Candidate], calibration: Calibration
) -> Judgement:
    """Return how likely the first candidate is right, and others, in this order.

    Its rivals are all maps that one exchange makes of it, those that leave one more of its objects
    without partner, and the others that were met; and that the right one is none of these.

    Parameters
    ----------
    problem
        With the first candidate, and ζ after each exchange in it.
    others
        The other maps met.
    calibration
        What was learned.
    """
    assert problem.exchanges is not None
    first, omissions, price = problem.candidates[0], problem.omissions, calibration.price
    kept = np.flatnonzero(first.partners >= 0)
    own, objects = first.partners[kept], len(first.partners)
    left_out = objects - len(kept)
    best = _value(first, price)
    steep = calibration.sharpness * objects**calibration.growth

    def odds(values: FloatArray, reserve: float = 0.0) -> FloatArray:
        """Return how much likelier maps are than the first."""
        raised: FloatArray = np.exp(np.minimum(steep * (values - best) + reserve, 50.0))
        return raised

    exchanged = odds(problem.exchanges - price * left_out / objects)
    omitted = np.zeros(len(kept))
    if omissions is not None:
        omitted = odds(omissions - price * (left_out + 1) / objects)
    rival_odds = odds(np.array([_value(other, price) for other in others]))
    news = np.array([_is_news(other.partners, first.partners) for other in others], dtype=bool)
    maps = np.array([other.partners for other in others]).reshape(-1, objects)[news]
    met_odds = rival_odds[news]
    unknown = float(odds(np.array([calibration.doubt]), calibration.reserve)[0])
    # An exchange between two objects stands in the rows of both.
    used = exchanged[:, own].sum()
    total = 1.0 + exchanged.sum() - 0.5 * used + omitted.sum() + met_odds.sum() + unknown
    against = exchanged.sum(axis=1) + omitted + (1.0 - calibration.luck) * unknown
    if len(maps):
        against += met_odds @ (maps[:, kept] != own)
    lines = np.zeros((objects, problem.table.argument_objects + 1))
    for k, partners in enumerate(maps):
        lines[np.arange(objects), partners] += met_odds[k]  # −1, none, is the last column
    lines[kept, :-1] += exchanged
    lines[kept, -1] += omitted
    lines /= total
    lines[kept, own] = 1.0 - against / total
    free = np.flatnonzero(first.partners < 0)
    elsewhere = met_odds @ (maps[:, free] >= 0) + (1.0 - calibration.luck) * unknown
    lines[free, -1] = 1.0 - elsewhere / total
    if problem.allowed is not None and problem.pinned is not None:
        alone, known = ~problem.allowed.any(axis=1), problem.pinned >= 0
        lines[alone | known] = 0.0
        lines[alone, -1] = 1.0
        lines[known, problem.pinned[known]] = 1.0
    judged = zip(others, (rival_odds / total).tolist(), strict=True)
    return Judgement(
        (
            JudgedMap(first.partners, float(1.0 / total)),
            *(JudgedMap(other.partners, probability) for other, probability in judged),
        ),
        np.clip(lines, 0.0, 1.0),
    )


def _value(candidate: Candidate, price: float) -> float:
    """Return what a map is worth: ζ less the price of the objects that it leaves out."""
    left_out, objects = int((candidate.partners < 0).sum()), len(candidate.partners)
    return candidate.confidence.total - price * left_out / objects


def _matched(partners: IntArray) -> tuple[int, ...]:
    return tuple(np.flatnonzero(partners >= 0).tolist())


def _is_news(rival: IntArray, best: IntArray) -> bool:
    """Whether a map is neither an exchange nor an omission away from the best."""
    ours, theirs = best >= 0, rival >= 0
    differing = np.flatnonzero(ours & (rival != best))
    if theirs.sum() < ours.sum():
        return len(differing) > 1 or theirs.sum() + 1 < ours.sum()
    if (theirs & ~ours).any():
        return True
    if len(differing) != 2:
        return len(differing) > 2
    g, h = differing
    return not (best[g] == rival[h] and best[h] == rival[g])
