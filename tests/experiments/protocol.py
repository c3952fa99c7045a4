"""The thesis's five experiments, and sweeps beside them, as work.

Each is what is matched with what: which sketches, what is removed, on which map, and by whom.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping

import numpy as np

from tests.experiments.cases import NOTHING, Removal
from tests.experiments.people import Person, Shapes
from tests.experiments.runs import Work
from tests.experiments.scenes import DRIVES, PLACES
from tests.experiments.study import SMALL, STRENGTH, Style

__all__ = [
    "LETTERS",
    "MAPS",
    "PARTS",
    "SKETCHES",
    "SMALL_TITLES",
    "STRENGTHS",
    "STRONGER",
    "UNEQUAL",
    "experiments",
    "one_missing",
    "times",
]

SKETCHES = 200
"""Of each scene; the thesis has nine that show all objects."""

LETTERS = "bcdefghij"
"""The thesis's sketches with all objects. Ours with these letters are the first nine."""

MAPS: Mapping[str, bool] = {"map": False, "grid": True}
"""Whether the map is an occupancy grid."""

UNEQUAL = {
    "A": {"k": Style(missing=2), "l": Style(missing=1), "m": Style(missing=1)},
    "B": {"k": Style(extra=1), "l": Style(extra=1), "m": Style(missing=2)},
}
"""What is missing or extra in the thesis's sketches (k) to (m)."""

STRENGTHS = (0.5, 0.7, 0.95, 1.25, 1.5, 2.0)
"""Of the sweep over how far drawings leave the truth."""

STRONGER = 1.05
"""Gives sketches (b) to (j) alone the thesis's mean ζ, without case (a); see ``calibrate``."""

SMALL_TITLES = ("small objects, upright", "small objects, turned")
"""Sketches of people calibrated on the parts of ζ, and the same ones with the paper turned."""

_NINE = len(LETTERS)
_GOLDEN_ANGLE = 137.5
_PAPERS = range(0, 360, 30)
_LARGE = {10: 4, 12: 3, 16: 2, 20: 2, 30: 1}
_SMALL = ("fsnn-pso", "easm", "auto", "default", "exact")
_LARGE_BY = ("easm", "auto", "default", "direct")
_FEWEST = 3
_FSNN, _FOLDED, _EASM = "fsnn-pso", "fsnn-folded", "easm"


def experiments(
    methods: tuple[str, ...], count: int = SKETCHES, only: Iterable[str] = ()
) -> dict[str, list[Work]]:
    """Return the work of the experiments, by title.

    Parameters
    ----------
    methods
        Names of methods. All get all sketches, but for the thesis's own, which search long:
        ``fsnn-pso`` gets a quarter of those with all objects and the first nine of others, where
        the thesis did not try it; ``easm`` gets half of those with one object missing on the
        occupancy grid, and fewer in the sweeps.
    count
        Sketches of each scene.
    only
        Some of :data:`PARTS`; all when left out.
    """
    chosen = set(only) or set(PARTS)
    return {
        title: works
        for part, make in PARTS.items()
        if part in chosen
        for title, works in make(methods, count).items()
    }


def times(count: int = SKETCHES) -> dict[str, list[Work]]:
    """Return what times are measured on, Table 4.5 and beyond: to be done in one process."""
    small = [
        Work("A", number, Style(), _smaller(number), methods=_SMALL)
        for number in range(max(1, count // 16))
    ]
    large = [
        Work(f"{objects}", number, Style(), methods=_LARGE_BY)
        for objects, most in _LARGE.items()
        for number in range(min(most, count))
    ]
    return {"times, 3 to 8 objects": small, "times, 10 to 30 objects": large}


def one_missing(place: str) -> tuple[Removal, ...]:
    """Return the removals of each object of a scene in turn."""
    return tuple(Removal((k,)) for k in range(len(PLACES[place].furniture)))


def _equal(map_: str, methods: tuple[str, ...], count: int) -> dict[str, list[Work]]:
    """Return experiments 1 and 2 (4.1 to 4.4) or 3 (4.6, 4.7): case (a), then all objects."""
    grids = (MAPS[map_],)
    own = [
        Work(place, drive, Style(traced=True), grids=grids, methods=methods)
        for place in PLACES
        for drive in range(min(count, DRIVES) if MAPS[map_] else 1)
    ]
    drawn = [
        Work(place, number, Style(), grids=grids, methods=those)
        for place in PLACES
        for number in range(count)
        for those in [_affordable(methods, number, fsnn=max(_NINE, count // 4))]
    ]
    return {f"case (a), {map_}": own, f"all objects, {map_}": drawn}


def _missing(map_: str, methods: tuple[str, ...], count: int) -> dict[str, list[Work]]:
    """Return experiments 4 or 5: every object removed in turn, and sketches (k) to (m)."""
    grids, divisor = (MAPS[map_],), 2 if MAPS[map_] else 1
    sweep = [
        Work(place, number, Style(), one_missing(place), grids, those)
        for place in PLACES
        for number in range(count)
        for those in [_affordable(methods, number, easm=max(_NINE, count // divisor))]
    ]
    few = max(1, count // 4)
    unequal = {
        f"sketches like ({letter}), {map_}": [
            Work(place, index * count + number, styles[letter], grids=grids, methods=those)
            for place, styles in UNEQUAL.items()
            for number in range(few)
            for those in [_affordable(methods, number, easm=max(_NINE, few // 2))]
        ]
        for index, letter in enumerate("klm")
    }
    return {f"one missing, {map_}": sweep, **unequal}


def _several(methods: tuple[str, ...], count: int) -> dict[str, list[Work]]:
    """Return more and more objects missing, in an order by chance, down to three: 4.12, 4.13."""
    works = []
    for place in PLACES:
        objects = len(PLACES[place].furniture)
        for number in range(count):
            order = np.random.default_rng((number, ord(place))).permutation(objects).tolist()
            removals = tuple(Removal(tuple(order[:k])) for k in range(1, objects - _FEWEST + 1))
            those = _affordable(methods, number, easm=max(_NINE, count // 8))
            works.append(Work(place, number, Style(), removals, methods=those))
    return {"several missing": works}


def _small(methods: tuple[str, ...], count: int) -> dict[str, list[Work]]:
    """Return people who draw things small, upright and with the paper turned anyhow: 4.1, 4.2."""
    those = _affordable(methods, 0)
    if _FSNN in methods:
        those = tuple(dict.fromkeys((_FSNN, _FOLDED, *those)))
    return {
        title: [
            Work(
                place,
                number,
                Style(SMALL, paper=turned * _GOLDEN_ANGLE * (number + 1) % 360.0),
                methods=those,
            )
            for place in PLACES
            for number in range(max(1, count // 4))
        ]
        for turned, title in enumerate(SMALL_TITLES)
    }


def _strength(methods: tuple[str, ...], count: int) -> dict[str, list[Work]]:
    """Return the sweep over strength, and many sketches at one that is a little stronger."""
    swift, sweep = _swift(methods), []
    for strength in STRENGTHS:
        style = Style(Person(strength))
        for place in PLACES:
            sweep += [
                Work(
                    place,
                    number,
                    style,
                    methods=_affordable(methods, number, easm=max(1, count // 16)),
                )
                for number in range(max(1, count // 8))
            ]
            sweep += [
                Work(place, number, style, one_missing(place), methods=swift)
                for number in range(max(1, count // 16))
            ]
    stronger = [
        Work(place, number, Style(Person(STRONGER)), (NOTHING, *one_missing(place)), methods=those)
        for place in PLACES
        for number in range(max(1, count // 8))
        for those in [_affordable(methods, number, fsnn=0, easm=_NINE)]
    ]
    return {"strength": sweep, f"strength {STRONGER:g}": stronger}


def _shapes(methods: tuple[str, ...], count: int) -> dict[str, list[Work]]:
    """Return people who draw outlines, and others who draw a box or an ellipse for everything."""
    swift = _swift(methods)
    works = [
        Work(place, number, Style(Person(STRENGTH, shapes=shapes)), removals, methods=swift)
        for shapes in Shapes
        for place in PLACES
        for removals in [(NOTHING, *one_missing(place))]
        for number in range(max(1, count // 8))
    ]
    return {"shapes": works}


def _rotation(methods: tuple[str, ...], count: int) -> dict[str, list[Work]]:
    """Return sketches with all objects and with one missing on paper turned all the way round."""
    works = []
    for place in PLACES:
        for number in range(max(1, count // 20)):
            those = _affordable(methods, number, fsnn=0, easm=max(1, count // 40))
            removals = (NOTHING, one_missing(place)[number % len(PLACES[place].furniture)])
            for paper in _PAPERS:
                style = Style(paper=float(paper))
                works.append(Work(place, number, style, removals, methods=those))
    return {"rotation": works}


def _both_ways(methods: tuple[str, ...], count: int) -> dict[str, list[Work]]:
    """Return sketches that lack one object and show one that is not there."""
    works = [
        Work(place, number, Style(missing=1, extra=1), methods=tuple(dict.fromkeys(those)))
        for place in PLACES
        for number in range(max(1, count // 2))
        for those in [(*_affordable(methods, number, fsnn=0), "default")]
    ]
    return {"missing and extra": works}


PARTS: Mapping[str, Callable[[tuple[str, ...], int], dict[str, list[Work]]]] = {
    "1": lambda methods, count: _equal("map", methods, count),
    "2": lambda methods, count: _equal("map", methods, count),
    "3": lambda methods, count: _equal("grid", methods, count),
    "4": lambda methods, count: _missing("map", methods, count) | _several(methods, count),
    "5": lambda methods, count: _missing("grid", methods, count),
    "small": _small,
    "strength": _strength,
    "rotation": _rotation,
    "shapes": _shapes,
    "both-ways": _both_ways,
}
"""The thesis's experiments by number, and the sweeps beside them. 1 and 2 are done together."""


def _affordable(
    methods: tuple[str, ...], number: int, *, fsnn: int = _NINE, easm: float = math.inf
) -> tuple[str, ...]:
    """Return the methods for a sketch: those that search long get the first ones alone."""
    most = {_FSNN: fsnn, _EASM: easm}
    return tuple(method for method in methods if number < most.get(method, math.inf))


def _swift(methods: tuple[str, ...]) -> tuple[str, ...]:
    """Return the methods that do not search long."""
    return _affordable(methods, 0, fsnn=0, easm=0)


def _smaller(number: int) -> tuple[Removal, ...]:
    """Return what turns scene A into scenes of 3 to 8 objects."""
    objects = len(PLACES["A"].furniture)
    order = np.random.default_rng(number).permutation(objects).tolist()
    return tuple(Removal(both=tuple(order[k:])) for k in range(_FEWEST, objects + 1))
