"""Matching sketches of a part of a map, with things forgotten and invented, and of other places.

They come from :mod:`tests.experiments.generators`, from which nothing is learned, as scenes.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product

import numpy as np

from sketchmatch import MatchResult, match
from sketchmatch.model import IntArray
from tests.experiments.arms import ARMS, Arm, Judged
from tests.experiments.drawings import Drawing
from tests.experiments.generators import KINDS, sample
from tests.experiments.methods import METHODS

__all__ = ["ArmWork", "arm_works", "drawing_of", "judged"]

_CONSIDERED = 100
_METHODS = ("auto", "default")
_SMALL = 8
_SLOW = {"auto": 10}


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


def drawing_of(arm: Arm, kind: str, number: int) -> Drawing:
    """Return one of the sketches of an arm."""
    return sample(
        kind,
        number,
        objects=arm.objects,
        missing=arm.missing,
        extra=arm.extra,
        wrong_place=arm.wrong_place,
        shapes=arm.shapes,
    )


def judged(kind: str, arm: Arm, number: int, method: str) -> Judged:
    """Match one sketch and compare what is said with the truth."""
    drawn = drawing_of(arm, kind, number)
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
