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


POSTERIOR = Posterior((), (), (), (), 0.0)
