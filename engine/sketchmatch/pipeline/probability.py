"""How likely an answer is right: a conditional logit over the maps that come close to it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from sketchmatch.model import BoolArray, FloatArray
from sketchmatch.pipeline.calibration import Calibration
from sketchmatch.pipeline.unmatched import PartSearch, Rival, net_confidence

__all__ = ["UNKNOWN", "Likelihood", "likelihood"]


@dataclass(frozen=True, eq=False)
class Likelihood:
    """How likely an answer is right.

    Attributes
    ----------
    of_map
        As a whole, or None where unknown.
    of_objects
        Shape (k,), for each matched object of the template, or None.
    """

    of_map: float | None = None
    of_objects: FloatArray | None = None


UNKNOWN = Likelihood()


def likelihood(
    found: PartSearch,
    exchanges: FloatArray,
    omissions: FloatArray | None,
    rivals: Iterable[Rival],
    calibration: Calibration,
) -> Likelihood:
    """Return how likely the best map is right.

    Its rivals are all maps that one exchange makes of it, those that leave one more of its objects
    without partner, and the others that were met; and that the right one is none of these.

    Parameters
    ----------
    found
        The best map.
    exchanges
        Shape (k, N'): ζ after each exchange, as
        :func:`sketchmatch.pipeline.alternatives.exchange_confidences` returns it.
    omissions
        Shape (k,): ζ without each object, or None.
    rivals
        The other maps met.
    calibration
        What was learned.
    """
    partners, objects = found.mapped.partners, found.part.objects
    left_out, price = found.part.left_out, calibration.price
    best = net_confidence(found.best.confidence, left_out, objects, price)
    met = [rival for rival in rivals if _is_news(rival, found)]
    met_values = np.array([rival.value(price) for rival in met])
    agreeing = np.array([_agreement(rival, found) for rival in met], dtype=bool)
    steep = calibration.sharpness * objects**calibration.growth

    def odds(values: FloatArray, reserve: float = 0.0) -> FloatArray:
        """Return how much likelier maps are than the best."""
        raised: FloatArray = np.exp(np.minimum(steep * (values - best) + reserve, 50.0))
        return raised

    exchanged = odds(exchanges - price * left_out / objects)
    omitted = np.zeros(len(partners))
    if omissions is not None:
        omitted = odds(omissions - price * (left_out + 1) / objects)
    met_odds = odds(met_values)
    unknown = float(odds(np.array([calibration.doubt]), calibration.reserve)[0])
    # An exchange between two objects stands in the rows of both.
    used = exchanged[:, partners].sum()
    total = 1.0 + exchanged.sum() - 0.5 * used + omitted.sum() + met_odds.sum() + unknown
    against = exchanged.sum(axis=1) + omitted + (1.0 - calibration.luck) * unknown
    if met:
        against += met_odds @ ~agreeing
    return Likelihood(float(1.0 / total), np.asarray(1.0 - against / total))


def _is_news(rival: Rival, found: PartSearch) -> bool:
    """Whether a map is neither an exchange nor an omission away from the best."""
    agree = _agreement(rival, found)
    differing = np.flatnonzero(~agree)
    if len(rival.kept) < len(found.part.kept):
        return len(differing) > 1 or len(rival.kept) + 1 < len(found.part.kept)
    if len(rival.kept) > len(found.part.kept) or not np.isin(rival.kept, found.part.kept).all():
        return True
    if len(differing) != 2:
        return len(differing) > 2
    g, h = differing
    ours, theirs = found.mapped.partners, rival.mapped.partners
    return not (ours[g] == theirs[h] and ours[h] == theirs[g])


def _agreement(rival: Rival, found: PartSearch) -> BoolArray:
    """Return on which objects of the best map another one agrees, shape (k,)."""
    known = dict(zip(rival.kept.tolist(), rival.mapped.partners.tolist(), strict=True))
    ours = zip(found.part.kept.tolist(), found.mapped.partners.tolist(), strict=True)
    return np.array([known.get(g, -1) == h for g, h in ours])
