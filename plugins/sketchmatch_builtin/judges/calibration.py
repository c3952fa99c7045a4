"""What was learned of how right maps are told from wrong ones: the one place of these numbers.

They come from ``python -m tests.experiments.learn``, which writes ``learned.json``, and a test
compares the two. Those of ζ: simulated sketches of the study's scenes and of random ones of 5 to
16 objects, with missing and extra objects, drawn well or badly, as outlines, boxes and ellipses;
none of those that the study's tables are made of. All hold for the default measure of similarity on
histograms of constant forces. Those of the judge ``posterior`` are too many for a module: it writes
them into ``posterior.json`` beside this one.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sketchmatch.model import ConfidenceWeights, FloatArray

__all__ = [
    "POSTERIOR",
    "Calibration",
    "Layers",
    "PlaceLayers",
    "Posterior",
    "calibrated",
    "default_price",
    "posterior_of",
]


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


class Layers(NamedTuple):
    """What maps are worth: a layer for each line, summed, and one for the sum and the whole.

    Attributes
    ----------
    of_lines, of_maps, of_scenes
        Shape (2, k) each: middle and scale of the numbers of lines, of maps and of scenes.
    first, first_bias
        Shape (k + 3, h) and (h,): from the k numbers of a line and those of the scenes.
    second, second_bias
        Shape (8 + 3 + h, g) and (g,): from the numbers of a map, of the scenes, and the sum.
    last, direct
        Shape (g,) and (8,): from the second layer, and from the numbers of a map.
    score
        What the score of an alignment counts for.
    """

    of_lines: FloatArray
    of_maps: FloatArray
    of_scenes: FloatArray
    first: FloatArray
    first_bias: FloatArray
    second: FloatArray
    second_bias: FloatArray
    last: FloatArray
    direct: FloatArray
    score: float


class PlaceLayers(NamedTuple):
    """Whether a sketch shows a place at all: one hidden layer.

    Attributes
    ----------
    of_places
        Shape (2, k): middle and scale of the numbers of a place.
    first, first_bias
        Shape (k, h) and (h,).
    last, direct
        Shape (h,) and (k,).
    constant
        The odds where all of them are 0.
    """

    of_places: FloatArray
    first: FloatArray
    first_bias: FloatArray
    last: FloatArray
    direct: FloatArray
    constant: float


class Posterior(NamedTuple):
    """What the judge ``posterior`` goes by.

    Attributes
    ----------
    maps, bare
        What maps are worth by all that is known, and by places, sizes and shapes alone.
    place
        What tells a place.
    labels
        Shape (2,): what labels count for that mean the same, and that do not.
    lost
        Shape (6,): what the numbers count for that say whether the right map is known.
    luck
        As in :class:`Calibration`.
    """

    maps: Layers
    bare: Layers
    place: PlaceLayers
    labels: FloatArray
    lost: FloatArray
    luck: float

    def layers(self, related: bool) -> Layers:
        """Return what maps are worth, by relations too or without them."""
        return self.maps if related else self.bare


def posterior_of(text: str) -> Posterior:
    """Return what the judge ``posterior`` goes by, from JSON as it is learned."""
    found = json.loads(text)
    maps, bare, place = (_arrays(found[part]) for part in ("maps", "bare", "place"))
    labels, lost = np.array(found["labels"]), np.array(found["lost"])
    return Posterior(
        Layers(**maps), Layers(**bare), PlaceLayers(**place), labels, lost, found["luck"]
    )


def _arrays(values: dict[str, Any]) -> dict[str, Any]:
    return {
        name: np.array(value) if isinstance(value, list) else value
        for name, value in values.items()
    }


POSTERIOR = posterior_of(Path(__file__).with_name("posterior.json").read_text(encoding="utf-8"))
"""Learned by ``python -m tests.experiments.learn``, which writes that file."""
