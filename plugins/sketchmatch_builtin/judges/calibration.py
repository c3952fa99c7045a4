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
        -0.4297,
        0.3136,
        0.2912,
        -2.075,
        -0.3398,
        -0.9891,
        0.1513,
        -0.1004,
        -0.6653,
        -0.2318,
        0.006945,
        -0.8,
        -0.3063,
        -0.796,
        -0.9143,
        -0.8325,
        0.7519,
        -0.1197,
        -0.3982,
        -0.2232,
        -0.6384,
        0.09125,
        -0.09985,
        -0.3646,
        0.2054,
        1.246,
        2.529,
    ),
    weights=(
        -0.7036,
        0.3072,
        0.1386,
        -1.637,
        -0.04136,
        -0.3224,
        0.2361,
        -0.2521,
        -1.084,
        -0.2533,
        0.0955,
        -1.105,
        -0.4852,
        -0.6718,
        -1.104,
        -1.059,
        0.6415,
        0.1091,
        -0.3945,
        -0.09757,
        -0.5293,
        0.7271,
        -1.662,
        -0.07721,
        13.48,
        -0.7141,
        1.805,
        -2.244,
        0.2157,
        -0.01621,
        -0.03135,
        0.1881,
        1.051,
        1.883,
        -0.4622,
        -0.1861,
        0.4141,
        -0.6868,
        0.4636,
        0.8639,
        -0.1458,
        -0.1309,
        -0.1634,
        -0.1739,
        -0.03552,
        -0.3168,
        -0.2454,
        -0.1578,
        -0.1541,
        0.1563,
        -0.2112,
        0.08646,
        0.3865,
        0.7265,
        1.243,
        0.169,
        -8.485,
        0.8365,
        -0.3009,
        -0.08448,
        0.4518,
        -0.1825,
        -0.2097,
        -0.1769,
        -0.005856,
        -0.04953,
        -0.2422,
        -0.376,
        -0.4544,
        -0.4694,
        0.7727,
        -1.615,
        -0.1632,
        0.2833,
        0.1572,
        0.151,
        0.4249,
        0.1513,
        -0.1495,
        0.06416,
        -0.3581,
        0.2672,
        -0.7094,
        2.609,
        -0.7301,
        13.77,
        0.1447,
        -0.009624,
        0.2845,
        0.2962,
        0.2433,
        1.226,
        0.04846,
        0.1261,
        0.4198,
        -0.8371,
        -0.4059,
        -0.5091,
        -0.111,
        -0.02314,
        -1.927,
        0.5054,
        0.02511,
        0.2525,
        0.1862,
        -0.285,
        0.4002,
        -0.2785,
        -0.1263,
        0.2334,
        0.08071,
        0.6336,
        -3.162,
        -0.1671,
        -2.468,
        0.9253,
        0.6222,
        -0.3272,
        -0.2744,
        0.04352,
        0.7797,
    ),
    place=(
        -2.577,
        -0.5376,
        -0.3927,
        0.002226,
        0.5172,
        0.03898,
        0.247,
        -0.04042,
        0.01287,
        0.5503,
        -0.1177,
        0.3975,
        -0.1318,
        0.1076,
        -0.2242,
        -1.404,
        1.346,
        0.03044,
        0.05633,
        -0.001561,
        0.2052,
        -0.1372,
        -0.138,
        -0.06345,
        0.1379,
        0.1435,
        0.1492,
        0.3954,
        0.5056,
    ),
    lost=(
        -4.998,
        0.2104,
        0.08296,
        -1.755,
        -1.743,
    ),
    luck=0.36,
)
