"""What a match is asked for, and whether it can be had."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from numbers import Integral, Real
from types import MappingProxyType
from typing import Any

from sketchmatch.api import Judge, Searcher, Segmentation
from sketchmatch.errors import InvalidInputError, Reason, counted, quoted
from sketchmatch.model import ConfidenceWeights, RequestWeights, Scene, Source
from sketchmatch.model.maps import MAX_DISTANCE, MAX_WEIGHT, WEIGHT_COUNTS
from sketchmatch.pipeline.former import Former
from sketchmatch.pipeline.guard import blaming
from sketchmatch.pipeline.knowledge import Pin, check_pins, check_synonyms
from sketchmatch.pipeline.selection import Pipeline, Profile, Selection
from sketchmatch.registry import Registry

__all__ = [
    "MatchRequest",
    "Pin",
    "alternatives_wanted",
    "check_objects_weighed",
    "finds_partial",
    "most_maps",
    "price_in_force",
]

_MAX_SEED = 2**64 - 1
_MAX_PRICE = 1e3
_MAX_ALTERNATIVES = 100
_ALTERNATIVES = 3


@dataclass(frozen=True)
class MatchRequest:
    """What to match, and how.

    Attributes
    ----------
    sketch, map
        Sources, or scenes and segmentations, which need none.
    selection
        Algorithms and parameters, by stage.
    seed
        0 … 2⁶⁴−1; the same request with the same seed gives the same result.
    time_budget
        Seconds after which the best answer so far is given, or None for no limit.
    weights
        Of ζσ, ζR and ζL in ζ, of ζS and ζM where there are five, and the exponent of distance in
        ζR where there are six; None for those of the profile, or else 1, 1, 1.
    alternatives
        How many of the next best object maps the result shall hold; None for 3, or as many as
        there are.
    profile
        Name of the profile to take the rest from; empty for the default one.
    allow_unmatched
        Whether an object may stay without partner on both sides where that is likelier; None for
        what the profile says, or else for whether searcher or judge find such maps by themselves.
        Where it may not, the smaller scene is matched completely.
    unmatched_price
        What a map loses for leaving all objects of the smaller scene out, and for some of them
        their share of it, in units of ζ; None for the judge's own.
    pins
        What is known of single objects; every searcher of object maps obeys.
    synonyms
        Groups of labels that mean the same. Labels are evidence, and force nothing.
    former
        What was found a moment ago in a sketch that was changed since, for a quick answer near it
        where the searcher allows that; None for the answer.

    Raises
    ------
    InvalidInputError
        If a value is out of its bounds.
    """

    sketch: Source | Scene | Segmentation
    map: Source | Scene | Segmentation
    selection: Selection = field(default_factory=lambda: MappingProxyType({}))
    seed: int = 0
    time_budget: float | None = None
    weights: RequestWeights | None = None
    alternatives: int | None = None
    profile: str = ""
    allow_unmatched: bool | None = None
    unmatched_price: float | None = None
    pins: tuple[Pin, ...] = ()
    synonyms: tuple[tuple[str, ...], ...] = ()
    former: Former | None = None

    def __post_init__(self) -> None:
        if not (isinstance(self.seed, Integral) and 0 <= self.seed <= _MAX_SEED):
            raise _refused("seed", f"is {quoted(self.seed)}; give an integer 0 … 2**64 − 1")
        object.__setattr__(self, "seed", int(self.seed))  # of NumPy, it would be one of 64 bits
        budget, price, wanted = self.time_budget, self.unmatched_price, self.alternatives
        if budget is not None and not 0 < _number("time_budget", budget) < math.inf:
            raise _refused("time_budget", f"is {budget:g} s; give a positive time or none at all")
        if self.weights is not None:
            object.__setattr__(self, "weights", _checked_weights(self.weights))
        if wanted is not None and not (
            isinstance(wanted, Integral) and 0 <= wanted <= _MAX_ALTERNATIVES
        ):
            raise _refused(
                "alternatives",
                f"is {quoted(wanted)}; give a whole number from 0 to {_MAX_ALTERNATIVES}",
            )
        if price is not None and not 0 < _number("unmatched_price", price) <= _MAX_PRICE:
            raise _refused(
                "unmatched_price", f"is {price:g}; give a number above 0, at most {_MAX_PRICE:g}"
            )
        if self.allow_unmatched not in (None, True, False):
            raise _refused(
                "allow_unmatched", f"is {quoted(self.allow_unmatched)}; give True or False"
            )
        object.__setattr__(self, "pins", check_pins(self.pins))
        object.__setattr__(self, "synonyms", check_synonyms(self.synonyms))


def check_objects_weighed(weights: ConfidenceWeights, searcher: Searcher) -> None:
    """Refuse to compare objects where the search compares nothing but pairs."""
    if weights.of_objects and not searcher.object_consistent:
        name = "shape" if weights.shape > 0 else "size"
        raise _refused(
            f"weights.{name}",
            f"needs a searcher that finds one object map, which {searcher.name!r} as set here need "
            "not do; choose another, such as 'auto', or give weight 0",
        )


def finds_partial(pipeline: Pipeline, registry: Registry) -> bool:
    """Whether searcher or judge find maps that leave objects out by themselves."""
    for algorithm in (pipeline.searcher, pipeline.judge):
        with blaming(algorithm, registry):
            if algorithm.partial:
                return True
    return False


def most_maps(searcher: Searcher, registry: Registry) -> int | None:
    """Return how many maps a search makes at most by its parameters; None where none says it."""
    with blaming(searcher, registry):
        most = searcher.most_maps
        if most is not None and not (isinstance(most, int) and most > 0):
            raise ValueError(
                f"its most_maps is {quoted(most)}, not a whole number above 0, or None"
            )
    return most


def price_in_force(
    request: MatchRequest,
    profile: Profile,
    weights: ConfidenceWeights,
    pipeline: Pipeline,
    registry: Registry,
) -> float:
    """Return the price of leaving objects out; infinite where that is not allowed."""
    searcher, price, allowed = pipeline.searcher, request.unmatched_price, request.allow_unmatched
    if allowed is None:
        allowed = profile.allow_unmatched
    if allowed is None:
        allowed = searcher.object_consistent and finds_partial(pipeline, registry)
    if not allowed:
        if price is not None:
            raise _refused(
                "unmatched_price",
                f"is {price:g}, but no object may stay unmatched; set allow_unmatched or drop it",
            )
        return math.inf
    if not searcher.object_consistent:
        raise _refused(
            "allow_unmatched",
            f"needs a searcher that finds one object map, which {searcher.name!r} as set here need "
            "not do; choose another, such as 'auto', or give False",
        )
    return _price_of(pipeline.judge, weights, registry) if price is None else price


def _price_of(judge: Judge, weights: ConfidenceWeights, registry: Registry) -> float:
    """Return the price that a judge has for leaving objects out."""
    with blaming(judge, registry):
        price = judge.price(weights)
        if not (isinstance(price, Real) and 0.0 < float(price) <= _MAX_PRICE):
            raise ValueError(
                f"its price is {quoted(price)}, not a number above 0, at most {_MAX_PRICE:g}"
            )
    return float(price)


def alternatives_wanted(requested: int | None, sketch: Scene, map_: Scene) -> int:
    """Return how many object maps beside the best there shall be."""
    few, many = sorted((len(sketch), len(map_)))
    there_are = math.perm(many, few) - 1
    if requested is None:
        return min(_ALTERNATIVES, there_are)
    if requested > there_are:
        raise _refused(
            "alternatives",
            f"is {requested}, but {few} objects on {many} have only "
            f"{counted(there_are, 'other object map')}; ask for no more",
        )
    return requested


def _checked_weights(given: RequestWeights) -> tuple[float, ...]:
    """Return weights, unless they make no ζ."""
    names = ConfidenceWeights._fields
    try:
        weights = tuple(given)
    except TypeError:
        raise _refused("weights", f"are {quoted(given)}; give three, five or six numbers") from None
    if len(weights) not in WEIGHT_COUNTS:
        raise _refused(
            "weights",
            f"are {len(weights)} numbers; give three ({', '.join(names[:3])}), five (with "
            f"{' and '.join(names[3:5])}) or six (with the exponent of {names[5]})",
        )
    for name, weight in zip(names, weights, strict=False):
        most = MAX_DISTANCE if name == "distance" else MAX_WEIGHT
        if not 0 <= _number(f"weights.{name}", weight) <= most:
            raise _refused(f"weights.{name}", f"is {weight:g}; give a number from 0 to {most:g}")
    if ConfidenceWeights(*weights).total == 0:
        raise _refused("weights", "are all zero; give at least one above zero")
    return weights


def _number(field_: str, given: Any) -> float:
    if not isinstance(given, Real):
        raise _refused(field_, f"is {quoted(given)}; give a number")
    return float(given)


def _refused(field_: str, words: str) -> InvalidInputError:
    return InvalidInputError(Reason.INVALID_FIELD, field_, words)
