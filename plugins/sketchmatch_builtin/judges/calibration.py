"""What was learned of how ζ tells right maps from wrong ones: the one place of these numbers.

They come from ``python -m tests.experiments.learn``, which writes ``learned.json``, and a test
compares the two: simulated sketches of the study's scenes and of random ones of 5 to 16 objects,
with missing and extra objects, drawn well or badly, as outlines, boxes and ellipses; none of those
that the study's tables are made of. All hold for the default measure of similarity on histograms of
constant forces.
"""

from __future__ import annotations

from dataclasses import dataclass

from sketchmatch.model import ConfidenceWeights

__all__ = ["Calibration", "calibrated", "default_price"]


@dataclass(frozen=True)
class Calibration:
    """How likely maps are that differ in ζ, for certain weights.

    A map of N template objects that is worth v = ζ − price·u/N has odds of exp(κ·N^α·v).

    Attributes
    ----------
    price
        Of leaving all template objects out.
    sharpness, growth
        κ and α.
    doubt, reserve
        That none of the maps known is right has e^reserve times the odds of a map that is worth
        ``doubt``.
    luck
        How many of the objects are right all the same where the map as a whole is not among those
        known.
    """

    price: float
    sharpness: float
    growth: float
    doubt: float
    reserve: float
    luck: float


_CALIBRATIONS = {
    ConfidenceWeights(): Calibration(0.406, 20.1, 1.04, 0.88, -4.29, 0.43),
}


def calibrated(weights: ConfidenceWeights) -> Calibration | None:
    """Return what was learned for these weights, up to a common factor; None where nothing was."""
    shares = _shares(weights)
    for known, calibration in _CALIBRATIONS.items():
        if all(abs(a - b) <= 1e-9 for a, b in zip(shares, _shares(known), strict=True)):
            return calibration
    return None


def default_price(weights: ConfidenceWeights) -> float:
    """Return the price of leaving objects out that fits weights; 1, 1, 1 stand for unknown ones."""
    return (calibrated(weights) or _CALIBRATIONS[ConfidenceWeights()]).price


def _shares(weights: ConfidenceWeights) -> tuple[float, ...]:
    *parts, distance = weights
    return (*(weight / weights.total for weight in parts), distance)


@dataclass(frozen=True)
class Posterior:
    """What the judge ``posterior`` goes by.

    Attributes
    ----------
    first
        What places, sizes and shapes count for: ``FIRST`` of the numbers of a map.
    weights
        What all numbers count for, by themselves and times each number of a skill.
    place
        What the numbers of a place count for.
    lost
        What the numbers count for that say whether the right map is known.
    luck
        As in :class:`Calibration`.
    """

    first: tuple[float, ...]
    weights: tuple[float, ...]
    place: tuple[float, ...]
    lost: tuple[float, ...]
    luck: float


POSTERIOR = Posterior(
    first=(
        -0.366,
        0.3876,
        0.2908,
        -2.28,
        -0.4059,
        -2.128,
        0.2235,
        0.3212,
        -1.206,
        0.006764,
        0.02791,
        -0.9822,
        -0.4677,
        -0.9857,
        -0.8403,
        -0.6422,
        1.1,
        -0.009903,
        -0.3839,
        -0.4748,
        -0.2176,
        0.03423,
        1.643,
    ),
    weights=(
        -0.1919,
        0.3259,
        0.2582,
        -1.296,
        -0.2776,
        -0.9527,
        0.1327,
        0.0875,
        -1.138,
        -0.2089,
        -0.000593,
        -1.3,
        -0.5933,
        -0.7697,
        -0.8608,
        -1.081,
        0.881,
        -0.05179,
        -0.2428,
        -0.496,
        0.5132,
        -1.083,
        -0.6268,
        0.1857,
        25.11,
        -0.6108,
        1.821,
        -1.749,
        0.02119,
        1.226,
        0.01506,
        -0.2083,
        0.6362,
        -0.6,
        0.5247,
        1.247,
        -0.1961,
        -0.1492,
        -0.4187,
        -0.453,
        -0.1318,
        -0.5122,
        -0.1109,
        0.3801,
        -0.2784,
        0.2036,
        -0.002306,
        -0.08967,
        0.2821,
        0.7965,
        -0.8673,
        -0.167,
        0.6707,
        1.069,
        0.1931,
        -0.5192,
        -0.2115,
        -0.2924,
        0.3564,
        0.1332,
        -1.253,
        -0.1874,
        0.4862,
        0.5448,
        -0.1907,
        -0.4102,
        0.2876,
        0.3066,
        -0.01325,
        0.3119,
        -0.08743,
        0.06049,
        0.1192,
        -0.4655,
        0.7035,
        -0.1989,
        -0.377,
        -5.843,
        1.352,
        0.0007729,
        -0.4411,
        0.3944,
        0.1854,
        -1.937,
        -0.3723,
        -1.265,
        0.0006999,
        0.2424,
        -1.402,
        0.4439,
        0.001612,
        0.1133,
        0.1895,
        -0.3216,
        0.8348,
        0.04954,
        -0.267,
        0.5466,
        -0.2055,
        1.915,
        0.7431,
        -0.75,
        -22.51,
        0.6998,
        0.4666,
    ),
    place=(
        -1.291,
        -0.4831,
        -0.07069,
        -0.04622,
        -6.756,
        0.05604,
        0.4675,
        -0.02634,
        0.1165,
        0.5312,
        -0.02359,
        0.1545,
        0.1917,
        0.08146,
        -0.585,
        -0.6041,
        1.453,
        0.02784,
        -0.01151,
        -0.1132,
        -0.14,
        -0.003563,
        -0.1342,
        -0.01357,
        0.03015,
        -0.04455,
        0.288,
        0.08271,
        0.07258,
    ),
    lost=(
        -5.201,
        0.2099,
        0.2425,
        -1.93,
        -2.557,
    ),
    luck=0.25,
)
