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
        -0.3829,
        0.2732,
        0.2216,
        -2.134,
        -0.2739,
        -0.756,
        0.1158,
        -0.08893,
        -1.052,
        -0.03323,
        0.01134,
        -0.7505,
        -0.4587,
        -0.935,
        -0.957,
        -0.8067,
        1.235,
        -0.09057,
        -0.3759,
        -0.3131,
        -0.2607,
        0.2068,
        -0.1697,
        -0.0001568,
        0.007951,
        1.826,
    ),
    weights=(
        -0.4118,
        0.2299,
        0.09269,
        -1.413,
        -0.09093,
        -0.7545,
        0.1525,
        -0.1953,
        -1.052,
        -0.1171,
        -0.006414,
        -1.005,
        -0.6087,
        -0.8544,
        -1.109,
        -0.9455,
        1.012,
        0.05432,
        -0.3373,
        -0.08746,
        -0.1137,
        -0.6289,
        -1.275,
        0.2664,
        15.42,
        -0.4488,
        1.863,
        -2.104,
        0.1128,
        -0.1137,
        0.1881,
        -0.005092,
        1.481,
        -0.6094,
        -0.2621,
        0.6229,
        -1.083,
        0.1462,
        0.9429,
        -0.1246,
        -0.04051,
        0.5355,
        -0.002509,
        -0.1607,
        -0.2545,
        -0.287,
        -0.2349,
        -0.3139,
        0.2861,
        -0.1732,
        -0.341,
        0.2949,
        0.06076,
        0.4697,
        0.2618,
        -11.27,
        0.8062,
        -0.1797,
        0.2365,
        0.6773,
        -0.3811,
        -0.8157,
        0.113,
        0.05492,
        0.1414,
        0.0718,
        -1.091,
        0.1294,
        0.2465,
        -0.2031,
        -0.2496,
        0.0471,
        -0.1688,
        0.0673,
        0.2324,
        0.3203,
        0.1529,
        -0.08633,
        0.2631,
        0.2582,
        -0.04192,
        -1.076,
        -0.186,
        3.536,
        -0.05023,
        0.2976,
        0.04346,
        -0.1532,
        -0.02125,
        0.01107,
        0.2022,
        0.1989,
        -1.177,
        -0.2132,
        0.5653,
        -0.2343,
        0.1164,
        -2.03,
        0.3514,
        0.1271,
        0.2678,
        0.1562,
        -0.238,
        0.6628,
        -0.1782,
        -0.1545,
        -0.1297,
        0.09203,
        1.584,
        0.5692,
        -0.6911,
        -5.697,
        0.9122,
        0.5602,
        -0.3533,
        0.1539,
        0.2238,
    ),
    place=(
        -1.481,
        -0.5284,
        -0.2008,
        -0.009645,
        -3.463,
        0.06937,
        0.4444,
        -0.01097,
        0.1276,
        0.4474,
        0.01325,
        0.2219,
        -0.1182,
        0.3993,
        -0.05596,
        -0.9421,
        1.107,
        0.0948,
        -0.03098,
        0.1306,
        -0.01756,
        -0.02986,
        -0.03905,
        -0.05341,
        0.01987,
        -0.07608,
        0.009988,
        0.2399,
        0.00571,
    ),
    lost=(
        -5.139,
        0.1388,
        0.444,
        -1.426,
        -2.346,
    ),
    luck=0.28,
)
