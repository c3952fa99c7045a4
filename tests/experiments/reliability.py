"""Whether probabilities are what they say: reliability diagrams and their error."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

__all__ = ["Reliability", "by_chance", "reliability"]

_TIMES = 200


@dataclass(frozen=True)
class Reliability:
    """How often answers of which probability are right.

    Attributes
    ----------
    bins
        For each bin of equal width that has cases: the mean probability given, the share right,
        and how many cases there are.
    error
        The expected calibration error: how far share and probability are apart, on average over
        all cases.
    """

    bins: tuple[tuple[float, float, int], ...]
    error: float


def reliability(answers: Iterable[tuple[float, bool]], bins: int = 10) -> Reliability:
    """Compare probabilities with what came true.

    Parameters
    ----------
    answers
        For each the probability given, within [0, 1], and whether the answer was right; at least
        one.
    bins
        How many of equal width there are.

    References
    ----------
    M. P. Naeini, G. Cooper, M. Hauskrecht, "Obtaining well calibrated probabilities using Bayesian
    binning", AAAI 2015.

    Examples
    --------
    >>> found = reliability([(0.9, True), (0.9, False), (0.2, False)])
    >>> found.bins
    ((0.2, 0.0, 1), (0.9, 0.5, 2))
    >>> round(found.error, 3)
    0.333
    """
    given, came_true = np.array([*answers], dtype=float).reshape(-1, 2).T
    if not len(given) or not ((given >= 0) & (given <= 1)).all():
        raise ValueError("reliability needs one probability within [0, 1] or more")
    index = np.minimum((given * bins).astype(int), bins - 1)
    filled: Sequence[int] = sorted(set(index.tolist()))
    found = tuple(
        (
            float(given[index == k].mean()),
            float(came_true[index == k].mean()),
            int((index == k).sum()),
        )
        for k in filled
    )
    error = sum(count * abs(said - true) for said, true, count in found) / len(given)
    return Reliability(found, error)


def by_chance(given: Sequence[float]) -> float:
    """Return the expected calibration error, in the mean, of probabilities that are true.

    With few answers it is far from 0: no more can be asked of those that were given.
    """
    rng, said = np.random.default_rng(0), np.asarray(given, dtype=float)
    errors = [
        reliability(zip(said.tolist(), (rng.random(len(said)) < said).tolist(), strict=True)).error
        for _ in range(_TIMES)
    ]
    return float(np.mean(errors))
