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
        -0.09175,
        0.2529,
        0.3504,
        -1.986,
        -0.1806,
        -0.9018,
        0.04196,
        0.1402,
        -0.8533,
        -0.1086,
        -0.005648,
        -1.002,
        -0.5108,
        -0.8215,
        -1.006,
        -0.5902,
        0.6402,
        -0.08458,
        -0.342,
        -0.3644,
        -0.5337,
        0.1504,
        -0.2246,
        -0.2501,
        0.1518,
        1.096,
        2.214,
    ),
    weights=(
        -0.1695,
        0.1208,
        0.1055,
        -1.037,
        -0.1358,
        -0.4857,
        0.06855,
        -0.04595,
        -0.459,
        -0.178,
        0.03609,
        -1.049,
        -0.4703,
        -0.7064,
        -0.9242,
        -0.7628,
        0.5888,
        0.02674,
        -0.2502,
        -0.1662,
        -0.4882,
        -0.3383,
        -2.083,
        0.2003,
        -0.5299,
        1.961,
        -2.04,
        0.2753,
        -0.1389,
        -0.3005,
        0.1657,
        1.004,
        1.564,
        -1.028,
        0.03214,
        0.2448,
        -1.155,
        0.4356,
        0.5472,
        -0.4002,
        -0.0786,
        -2.297,
        0.2095,
        0.259,
        -0.297,
        0.01424,
        -0.1442,
        0.0002208,
        0.04772,
        -0.05849,
        0.03156,
        0.7141,
        0.7435,
        0.4838,
        -0.118,
        0.5891,
        -0.506,
        0.2786,
        0.3916,
        -0.1417,
        0.2507,
        -0.8393,
        0.1523,
        -0.05903,
        0.08779,
        0.1877,
        -1.46,
        0.4101,
        0.3659,
        0.4457,
        -0.07861,
        -0.04869,
        -0.05735,
        0.06281,
        0.2062,
        0.04629,
        0.07393,
        -0.09257,
        -0.1976,
        0.2194,
        -0.7489,
        2.208,
        -1.092,
        -0.1093,
        0.1708,
        0.03557,
        0.4895,
        -0.1078,
        0.4776,
        0.2168,
        0.2856,
        0.4471,
        -1.339,
        -0.2263,
        0.2439,
        -0.1711,
        0.00511,
        -1.183,
        0.2617,
        -0.03878,
        0.05005,
        0.03315,
        -0.129,
        0.3041,
        -0.1397,
        -0.1447,
        0.03097,
        0.1952,
        0.2642,
        -1.183,
        -0.9182,
        0.5314,
        0.4298,
        -0.2977,
        0.1279,
        0.1737,
        0.8973,
    ),
    place=(
        -1.785,
        -0.583,
        -0.3617,
        -0.008209,
        -2.646,
        0.02064,
        0.3033,
        -0.2517,
        0.06934,
        0.4053,
        -0.01679,
        0.2766,
        -0.002301,
        -1.382,
        -0.4257,
        -1.268,
        1.721,
        0.01863,
        -0.01901,
        -0.0008137,
        0.3268,
        0.06373,
        -0.1602,
        -0.1118,
        0.1803,
        0.01644,
        0.2564,
        0.3493,
        0.415,
    ),
    lost=(
        -4.861,
        0.201,
        0.02941,
        -1.736,
        -2.095,
    ),
    luck=0.36,
)
