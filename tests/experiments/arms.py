"""Sketches of a part of a map, with things forgotten and invented, and of other places.

They come from :mod:`tests.experiments.generators`, from which nothing is learned, as scenes.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np

from sketchmatch import MatchResult, match
from sketchmatch.model import IntArray
from tests.experiments.drawings import Drawing
from tests.experiments.generators import KINDS, sample
from tests.experiments.methods import METHODS
from tests.experiments.people import Shapes

__all__ = ["ARMS", "Arm", "ArmWork", "Judged", "arm_works", "judged"]

_CONSIDERED = 100
_METHODS = ("auto", "default")
_SMALL = 8
_SLOW = {"auto": 10}


@dataclass(frozen=True)
class Arm:
    """A kind of case.

    Attributes
    ----------
    name
        What tables call it.
    objects, missing, extra, wrong_place, shapes
        As for :func:`tests.experiments.generators.sample`; eight neighbours are seen.
    """

    name: str
    objects: int
    missing: int = 0
    extra: int = 0
    wrong_place: bool = False
    shapes: Shapes = Shapes.OUTLINES

    def drawing(self, kind: str, number: int) -> Drawing:
        """Return one of its sketches."""
        return sample(
            kind,
            number,
            objects=self.objects,
            missing=self.missing,
            extra=self.extra,
            wrong_place=self.wrong_place,
            shapes=self.shapes,
        )


ARMS: Mapping[str, tuple[Arm, ...]] = {
    "parts": (
        Arm("8 of 8", 8),
        *(Arm(f"7 of 8, {shapes}", 8, missing=1, shapes=shapes) for shapes in Shapes),
        Arm("7 of 8 and 1 extra", 8, missing=1, extra=1),
        Arm("6 of 8 and 2 extra", 8, missing=2, extra=2),
        Arm("8 of 20", 20),
        Arm("7 of 20 and 1 extra", 20, missing=1, extra=1),
        Arm("6 of 20 and 2 extra", 20, missing=2, extra=2),
        Arm("8 of 36", 36),
        Arm("8 of 60", 60),
    ),
    "places": tuple(
        Arm(f"8 of another {objects}", objects, wrong_place=True) for objects in (8, 20, 36, 60)
    ),
}
"""The arms of the study, by the experiments that they belong to."""


@dataclass(frozen=True)
class Judged:
    """What a method made of a sketch, and how sure it was.

    Attributes
    ----------
    kind, arm, number, method
        What was done.
    objects, right
        How many sketched objects there are, and of how many the partner, or that there is none, is
        as it should be.
    among
        Whether the right map is the answer or among the next best hundred.
    probability, place
        That the map is right, and that the place is; None where unknown.
    lines
        For each sketched object the probability of what the answer says of it, where one is given,
        and whether that is so.
    seconds
        Of the match, from the scenes on.
    """

    kind: str
    arm: Arm
    number: int
    method: str
    objects: int
    right: int
    among: bool
    probability: float | None
    place: float | None
    lines: tuple[tuple[float, bool], ...]
    seconds: float

    @property
    def perfect(self) -> bool:
        """Whether the answer is wholly right; of a wrong place none is."""
        return self.right == self.objects and not self.arm.wrong_place


@dataclass(frozen=True)
class ArmWork:
    """What is to be done with one sketch."""

    kind: str
    arm: Arm
    number: int
    methods: tuple[str, ...]

    def done(self) -> list[Judged]:
        """Do it."""
        return [judged(self.kind, self.arm, self.number, method) for method in self.methods]


def arm_works(
    methods: Iterable[str], count: int, only: Iterable[str] = ()
) -> dict[str, list[ArmWork]]:
    """Return the work of the experiments, by what progress calls it.

    Parameters
    ----------
    methods
        Of these ``default`` gets all sketches, and ``auto`` a tenth of those whose map has more
        objects than the sketch, which it searches long.
    count
        Sketches of each arm.
    only
        Some of :data:`ARMS`.
    """
    those = [method for method in _METHODS if method in set(methods)]
    return {
        f"{experiment}, {kind}": [
            ArmWork(kind, arm, number, tuple(m for m in those if number < _most(m, arm, count)))
            for arm, number in product(ARMS[experiment], range(count))
        ]
        for experiment, kind in product(only, KINDS)
    }


def judged(kind: str, arm: Arm, number: int, method: str) -> Judged:
    """Match one sketch and compare what is said with the truth."""
    drawn = arm.drawing(kind, number)
    started = time.perf_counter()
    result = _answer(drawn, method, 0)
    seconds = time.perf_counter() - started
    found = _partners(result)
    true = found == drawn.truth
    wholly = bool(true.all()) and not arm.wrong_place
    return Judged(
        kind,
        arm,
        number,
        method,
        len(true),
        int(true.sum()),
        wholly or (not arm.wrong_place and _among(drawn, method)),
        result.probability,
        result.place_probability,
        tuple((said, bool(true[k])) for k, said in _said(result)),
        seconds,
    )


def _answer(drawn: Drawing, method: str, alternatives: int) -> MatchResult:
    chosen = METHODS[method]
    options = {**chosen.options, "alternatives": alternatives}
    return match(drawn.scene, drawn.map, searcher=chosen.searcher, **options)


def _among(drawn: Drawing, method: str) -> bool:
    """Whether the right map is among the alternatives, when many are asked for."""
    result = _answer(drawn, method, _CONSIDERED)
    true_map = {k: int(partner) for k, partner in enumerate(drawn.truth) if partner >= 0}
    return any(each.object_map == true_map for each in result.alternatives)


def _partners(result: MatchResult) -> IntArray:
    found = np.full(len(result.sketch), -1)
    found[[*result.object_map]] = [*result.object_map.values()]
    return found


def _said(result: MatchResult) -> list[tuple[int, float]]:
    """Return the sketched objects of whose lines a probability is given, and that."""
    lines = [
        (each.sketch_object, each.probability)
        for each in result.matches
        if each.probability is not None
    ]
    unmatched = result.unmatched_sketch_probabilities
    return [*lines, *zip(result.unmatched_sketch_objects, unmatched, strict=False)]


def _most(method: str, arm: Arm, count: int) -> int:
    """Return how many sketches of an arm a method gets."""
    return count if arm.objects <= _SMALL else max(1, count // _SLOW.get(method, 1))
