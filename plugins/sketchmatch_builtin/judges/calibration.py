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
        -0.3,
        0.2691,
        0.1931,
        -1.947,
        -0.2208,
        -1.067,
        0.1503,
        0.06289,
        -0.8998,
        -0.07768,
        -0.01895,
        -0.797,
        -0.45,
        -0.8252,
        -0.9695,
        -0.5508,
        0.7229,
        -0.08318,
        -0.337,
        -0.3961,
        -0.4596,
        0.04674,
        -0.1471,
        -0.1384,
        0.1655,
        1.191,
        2.279,
    ),
    weights=(
        -0.401,
        0.1646,
        -0.06354,
        -1.178,
        -0.1312,
        -0.6894,
        0.2027,
        -0.1344,
        -0.9476,
        -0.1454,
        0.02875,
        -0.984,
        -0.4674,
        -0.6972,
        -0.8868,
        -0.7096,
        0.6524,
        0.04802,
        -0.2776,
        -0.1914,
        -0.2445,
        -0.3972,
        -1.677,
        0.09513,
        7.225,
        -0.5883,
        1.927,
        -2.028,
        0.1908,
        -0.05327,
        -0.1024,
        0.1713,
        1.068,
        1.655,
        -0.6381,
        0.04732,
        0.431,
        -1.215,
        0.5333,
        0.2993,
        -0.2417,
        0.05746,
        -1.052,
        0.02444,
        0.1596,
        -0.5311,
        -0.1382,
        -0.1878,
        -0.1784,
        0.0412,
        -0.1391,
        0.004504,
        0.547,
        1.075,
        -0.1541,
        -0.1513,
        -17.08,
        0.9488,
        -0.3157,
        0.1424,
        0.4793,
        -0.342,
        -0.21,
        -0.9405,
        0.06668,
        -0.02944,
        0.406,
        0.1097,
        -0.8911,
        0.1025,
        0.4992,
        0.3735,
        -0.09154,
        -0.03857,
        0.1182,
        0.0577,
        0.1639,
        0.1292,
        0.07481,
        -0.09549,
        -0.07317,
        -0.07464,
        -0.3766,
        1.887,
        -0.5483,
        0.2734,
        0.08771,
        0.3872,
        -0.07635,
        0.04608,
        -0.01673,
        0.2368,
        0.06106,
        0.2177,
        0.4476,
        -1.111,
        -0.3142,
        0.517,
        -0.2953,
        -0.03964,
        -1.366,
        0.3424,
        0.03054,
        0.2401,
        0.1006,
        -0.1738,
        0.3965,
        -0.1467,
        -0.1097,
        0.0255,
        0.02563,
        0.3548,
        -1.108,
        -0.3935,
        0.4878,
        0.4995,
        0.3532,
        -0.2974,
        0.007363,
        0.2011,
        1.091,
    ),
    place=(
        -1.581,
        -0.5886,
        -0.3799,
        -0.01262,
        -3.108,
        0.02144,
        0.1538,
        -0.2466,
        0.05248,
        0.427,
        -0.01766,
        0.2817,
        0.0004309,
        -1.43,
        -0.384,
        -1.217,
        2.371,
        0.004917,
        0.01372,
        0.01577,
        0.3038,
        0.0339,
        -0.1624,
        -0.1081,
        0.2161,
        0.004137,
        0.2112,
        0.2837,
        0.4203,
    ),
    lost=(
        -4.954,
        0.2078,
        0.0302,
        -1.773,
        -2.099,
    ),
    luck=0.37,
)
