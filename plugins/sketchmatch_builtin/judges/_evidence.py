"""What the judge ``posterior`` goes by: numbers of a map, of a sketch, and of a place.

A map of a sketch is described by the parts that :mod:`sketchmatch_builtin.alignment` measures,
sums over its lines, and a place by how far the best of its maps exceeds what chance achieves.
What each number counts for is learned; this says what they are.

How much a deviation says depends on how well somebody draws, so each number counts the more or
less by how far the best map leaves places, sizes and shapes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sketchmatch.model import FloatArray, IntArray
from sketchmatch_builtin.alignment import PARTS, Part
from sketchmatch_builtin.judges.calibration import Posterior

__all__ = [
    "FIRST",
    "NUMBERS",
    "Described",
    "Weighed",
    "detailed",
    "lost_numbers",
    "numbers",
    "place_numbers",
    "skill",
    "weighed",
]

_MORE = ("matched_among_many", "matched_share", "matched_covering")

NUMBERS = (*PARTS, *_MORE)
"""What a map is described by."""

_RELATIONS = (Part.SIMILARITY, Part.ROTATION, Part.DILATION, Part.SELF)

FIRST = np.array(
    [k for k, name in enumerate(NUMBERS) if k not in _RELATIONS and name not in ("alike", "unlike")]
)
"""Which of them the places, sizes and shapes of objects alone tell."""

_BY_SKILL = np.array(
    [
        k
        for k, name in enumerate(NUMBERS)
        if name not in ("offset", "bend", "alike", "unlike", "matched_among_many")
    ]
)

_SCATTERS = (Part.SCATTER, Part.SCATTER_SIZE, Part.SCATTER_SHAPE)
_USUAL = (1.6, 1.2, 1.8)

_NONE = -30.0

_MOST_DRAWN, _PLAIN, _CAREFUL = 16, 50.0, -0.5
"""How far numbers go: many objects, and lines without a fault, lie beyond what was learned from,
where what is linear may say anything."""


@dataclass(frozen=True, eq=False)
class Described:
    """The maps of a sketch in numbers.

    Attributes
    ----------
    maps
        int64, shape (c, n), at least one: the mapped object of each sketched one, −1 for none.
    numbers
        Shape (c, len(NUMBERS)).
    decoys
        The numbers of the maps of each decoy, maybe of none.
    drawn, mapped
        How many objects there are.
    """

    maps: IntArray
    numbers: FloatArray
    decoys: tuple[FloatArray, ...]
    drawn: int
    mapped: int


def numbers(parts: FloatArray, drawn: int, mapped: int) -> FloatArray:
    """Return what maps are described by.

    Parameters
    ----------
    parts
        Shape (c, parts), as measured.
    drawn, mapped
        How many objects there are.

    Returns
    -------
    ndarray
        Shape (c, len(NUMBERS)).
    """
    matched = parts[:, Part.MATCHED]
    bounded = parts.copy()
    for part, usual in zip(_SCATTERS, _USUAL, strict=True):
        bounded[:, part] = np.maximum(parts[:, part], matched * (_CAREFUL - usual))
    return np.column_stack(
        [
            bounded,
            matched * math.log(mapped),
            matched * matched / drawn,
            matched * min(drawn, mapped) / max(drawn, mapped),
        ]
    )


def skill(best: FloatArray) -> FloatArray:
    """Return how well somebody draws, by the best map, shape (3,); less is better."""
    left: FloatArray = best[[*_SCATTERS]] / max(best[Part.MATCHED], 1.0) + np.array(_USUAL)
    return left


def detailed(described: FloatArray, drawing: FloatArray) -> FloatArray:
    """Return the numbers of maps, and most of them times each of the numbers of a skill."""
    by_skill = described[:, _BY_SKILL]
    return np.hstack([described, *(by_skill * each for each in drawing)])


def place_numbers(known: Described, first: FloatArray) -> FloatArray:
    """Return what says whether a sketch shows a place at all.

    Decoys are what the sketch is not: mirrored, or with things in each other's places. The best
    that they achieve on the map is what chance achieves there.

    Parameters
    ----------
    known
        The maps and decoys.
    first
        Shape (len(FIRST),): what places, sizes and shapes count for.
    """
    worths, maps = known.numbers[:, FIRST] @ first, known.maps
    drawn = min(known.drawn, _MOST_DRAWN)
    best = int(worths.argmax())
    top = float(worths[best])
    chance = [float((each[:, FIRST] @ first).max(initial=_NONE)) for each in known.decoys]
    shared = ((maps == maps[best]) & (maps[best] >= 0)).sum(axis=1)
    other = shared <= max(1, np.count_nonzero(maps[best] >= 0) // 4)
    rival = float(worths[other].max(initial=float(worths.min()) - 4.0))
    part = drawn / known.drawn
    most, mean, lead = (
        min(part * (top - each), _PLAIN) for each in (max(chance), float(np.mean(chance)), rival)
    )
    top = min(part * top, _PLAIN)
    many, row = math.log(known.mapped), known.numbers[best]
    matched = max(row[Part.MATCHED], 1.0)
    drawing = np.array([*skill(row), matched / known.drawn])
    return np.array(
        [
            1.0,
            drawn,
            many,
            drawn * many,
            1.0 / drawn,
            top,
            top / drawn,
            most,
            mean,
            _above(most),
            lead,
            _above(lead),
            min(most, lead),
            *drawing,
            *(most * drawing),
            *(drawn * drawing),
            *(many * drawing),
        ]
    )


def _above(difference: float) -> float:
    """Return a smooth positive part."""
    return float(np.logaddexp(0.0, np.clip(difference, -20.0, 20.0)))


@dataclass(frozen=True)
class Weighed:
    """What the numbers of maps come to.

    Attributes
    ----------
    shares
        Shape (c,): how likely each is right if one of them is.
    lost
        How likely none of them is, in this place.
    elsewhere
        How likely the sketch does not show this place.
    """

    shares: FloatArray
    lost: float
    elsewhere: float


def weighed(known: Described, learned: Posterior) -> Weighed:
    """Return what the numbers of maps come to."""
    first, rows = np.array(learned.first), known.numbers
    best = rows[(rows[:, FIRST] @ first).argmax()]
    scores = detailed(rows, skill(best)) @ np.array(learned.weights)
    shares = np.exp(scores - scores.max())
    shares /= shares.sum()
    here = place_numbers(known, first) @ np.array(learned.place)
    lost = lost_numbers(shares, known.drawn, known.mapped) @ np.array(learned.lost)
    return Weighed(shares, _logistic(lost), _logistic(-here))


def lost_numbers(shares: FloatArray, drawn: int, mapped: int) -> FloatArray:
    """Return what says whether the right map is among those that are known."""
    few = min(drawn, _MOST_DRAWN)
    return np.array([1.0, few, math.log(mapped), math.log(shares.max()), drawn / mapped])


def _logistic(odds: float) -> float:
    return float(1.0 / (1.0 + math.exp(-min(max(odds, -50.0), 50.0))))
