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
        -0.5068,
        0.3994,
        0.2537,
        -2.491,
        -0.3296,
        -1.222,
        0.2124,
        -0.07695,
        -0.9604,
        -0.2652,
        0.08986,
        -0.8091,
        -0.4801,
        -0.9183,
        -0.8922,
        -1.257,
        1.205,
        -0.2672,
        -0.3704,
        -0.2483,
        -0.02752,
        0.1303,
        0.0009044,
        -0.1154,
        0.00499,
        1.869,
    ),
    weights=(
        -0.7589,
        0.374,
        0.1849,
        -2.091,
        -0.0523,
        -0.4907,
        0.3319,
        -0.398,
        -1.031,
        -0.295,
        0.1441,
        -1.056,
        -0.58,
        -0.8737,
        -0.8981,
        -1.299,
        0.9989,
        -0.1684,
        -0.388,
        -0.05149,
        -0.1097,
        -1.782,
        -1.114,
        0.133,
        14.5,
        -0.6598,
        1.784,
        -1.877,
        0.2211,
        0.06746,
        0.2773,
        -0.00475,
        1.472,
        -1.167,
        -0.1476,
        0.4185,
        -0.7641,
        0.2825,
        0.07301,
        0.2087,
        -0.08124,
        -0.6837,
        0.09023,
        -0.01754,
        -0.1819,
        -0.2445,
        -0.2319,
        -0.2511,
        0.2439,
        -0.2466,
        -0.03328,
        0.07118,
        0.4746,
        1.256,
        0.2308,
        0.5267,
        0.6768,
        0.3774,
        -0.1467,
        0.5674,
        -0.244,
        -0.3582,
        0.07493,
        -0.004588,
        0.9458,
        -0.362,
        -0.1556,
        -0.1898,
        0.3537,
        0.1035,
        -0.1568,
        -0.2441,
        0.02168,
        0.06443,
        0.3062,
        0.4273,
        0.3624,
        -0.04182,
        0.2545,
        0.36,
        -0.7882,
        -2.395,
        -0.503,
        11.96,
        0.2652,
        0.4706,
        -0.02108,
        -0.4862,
        0.01824,
        0.1384,
        0.1367,
        0.3012,
        -0.9937,
        -0.3193,
        -0.2075,
        -0.225,
        0.2153,
        -2.28,
        0.3216,
        0.2158,
        0.1665,
        0.1505,
        -0.3658,
        0.6379,
        -0.1411,
        -0.09038,
        -0.06276,
        0.2271,
        2.516,
        -1.152,
        -0.6584,
        1.522,
        0.7986,
        0.1516,
        -0.1728,
        -0.07331,
        0.3202,
    ),
    place=(
        -1.862,
        -0.472,
        -0.2242,
        -0.02647,
        -3.993,
        0.06983,
        0.4314,
        0.02891,
        0.1249,
        0.5962,
        0.0564,
        0.1853,
        -0.0214,
        -0.009671,
        0.2005,
        -0.886,
        0.6428,
        0.1291,
        -0.1482,
        0.1063,
        -0.1816,
        -0.03113,
        -0.07828,
        -0.08406,
        0.07027,
        0.01446,
        0.009718,
        0.2836,
        0.1951,
    ),
    lost=(
        -5.227,
        0.1741,
        0.3003,
        -1.768,
        -1.694,
    ),
    luck=0.32,
)
