"""What the judge ``posterior`` goes by: what maps are worth, and what a place is.

A map is worth what its lines, summed, and a few numbers of the whole speak for it: what a hidden
layer makes of each line is added up, and a second one weighs the sum. Nothing depends on the order
of objects, and every deviation counts by what the others are. A place is told by how far the best
map exceeds what chance achieves. What each number counts for is learned; this says what they are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sketchmatch.model import BoolArray, FloatArray, IntArray
from sketchmatch_builtin.alignment import Measured, Whole
from sketchmatch_builtin.judges.calibration import Layers, Posterior

__all__ = [
    "AT_FIRST",
    "FARTHEST",
    "LINES",
    "Described",
    "Weighed",
    "best_first",
    "line_numbers",
    "lost_numbers",
    "map_numbers",
    "place_numbers",
    "scaled_lines",
    "scene_numbers",
    "settled",
    "weighed",
    "within",
    "worths",
]

_LABEL = 2.0
"""What a label that means the same, or does not, is worth at first sight."""

_MOST_DRAWN = 16
AT_FIRST = 0.3
FARTHEST = 5.0
"""How far numbers go, in standard deviations of what was learned from: beyond, what is linear may
say anything."""

LINES = 0.25
_UNRELATED = 9
"""How many numbers of lines there are without relations: the first ones."""

_MOST_BESIDE = 9.0
"""What others deviate at most, where deviations are compared with theirs."""

_NONE = -30.0
_DIGITS = 12


@dataclass(frozen=True, eq=False)
class Described:
    """The maps of a sketch in numbers.

    Attributes
    ----------
    maps
        int64, shape (c, n), at least one: the mapped object of each sketched one, −1 for none;
        those that fit best at first sight come first.
    measured
        What speaks for each.
    decoys
        What speaks for the best maps of each decoy.
    drawn, mapped
        How many objects there are.
    related
        Whether relations are those that were learned from.
    """

    maps: IntArray
    measured: Measured
    decoys: tuple[Measured, ...]
    drawn: int
    mapped: int
    related: bool


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


def best_first(measured: Measured) -> IntArray:
    """Return the order of maps by how well they fit at first sight; of equal ones as they come."""
    labels = measured.wholes[:, Whole.ALIKE] - measured.wholes[:, Whole.UNLIKE]
    worth = settled(measured.wholes[:, Whole.SCORE] + _LABEL * labels)
    order: IntArray = np.argsort(-worth, kind="stable")
    return order


def settled(values: FloatArray) -> FloatArray:
    """Return values without the digits that rounding leaves, so that equal ones are equal."""
    mantissas, exponents = np.frexp(values)
    return np.asarray(np.ldexp(np.round(mantissas, _DIGITS), exponents))


def line_numbers(measured: Measured, related: bool) -> FloatArray:
    """Return what describes lines; 0 for objects without partner.

    Each deviation counts for itself, and beside those of the other lines of its map: people who
    draw all else with care have drawn this with care too.

    Returns
    -------
    ndarray
        Shape (c, n, 24), or 9 where relations do not count.
    """
    place, size, shape, round_, own, relation, way, near, alone, bent, room, form = np.moveaxis(
        measured.lines, 2, 0
    )
    numbers = [
        np.ones_like(place),
        np.log(0.003 + place),
        np.minimum(np.sqrt(place), 3.0),
        np.log(0.003 + size**2),
        np.clip(size, -3.0, 3.0),
        np.log(0.003 + shape),
        round_,
        np.log(0.01 + way),
        np.log(0.01 + near),
    ]
    if related:
        deviations = (alone, bent, size**2, shape, way, near, own, relation)
        numbers += [
            np.log(0.003 + own),
            relation,
            *(_beside(each, measured.matched) for each in deviations),
            np.log(0.003 + alone),
            np.log(0.003 + bent),
            np.log(0.01 + room),
            np.log(0.01 + form),
            _beside(form, measured.matched),
        ]
    return np.stack(numbers, axis=2) * measured.matched[:, :, None]


def _beside(deviations: FloatArray, matched: BoolArray) -> FloatArray:
    """Return ln of deviations, less that of the mean over the other lines of each map."""
    others = np.maximum(matched.sum(axis=1, keepdims=True) - 1, 1)
    bounded = np.minimum(deviations, _MOST_BESIDE) * matched
    mean = (bounded.sum(axis=1, keepdims=True) - bounded) / others
    beside: FloatArray = np.log(0.01 + deviations) - np.log(0.01 + mean)
    return beside


def map_numbers(measured: Measured, drawn: int) -> FloatArray:
    """Return what describes maps as wholes, shape (c, 8)."""
    matched, missing, crowd, offset, bend = measured.wholes[:, Whole.MATCHED : Whole.BEND + 1].T
    return np.column_stack(
        [offset, bend, matched, missing, crowd, matched / drawn, missing / drawn, crowd / drawn]
    )


def scene_numbers(known: Described) -> FloatArray:
    """Return what describes both scenes, shape (3,)."""
    return np.array([math.log(known.drawn), math.log(known.mapped), 1.0 / known.drawn])


def worths(known: Described, measured: Measured, layers: Layers, related: bool) -> FloatArray:
    """Return what maps are worth, shape (c,), up to what is the same for all maps of a sketch.

    Parameters
    ----------
    known
        Whose maps, or whose decoy's, they are.
    measured
        What speaks for them.
    layers
        What was learned, with relations or without.
    related
        Whether relations count, or places, sizes and shapes alone.
    """
    lines = scaled_lines(line_numbers(measured, related), measured.matched, layers.of_lines)
    scene = within(scene_numbers(known), layers.of_scenes)
    whole = within(map_numbers(measured, known.drawn), layers.of_maps)
    width = lines.shape[2]
    # One product of two matrices, where there would be one for each map.
    hidden = lines.reshape(-1, width) @ layers.first[:width]
    hidden += scene @ layers.first[width:] + layers.first_bias
    summed = LINES * np.maximum(hidden, 0.0, out=hidden).reshape(*lines.shape[:2], -1).sum(axis=1)
    among = np.hstack([whole, np.broadcast_to(scene, (len(whole), len(scene))), summed])
    second = np.maximum(among @ layers.second + layers.second_bias, 0.0)
    score = AT_FIRST * measured.wholes[:, Whole.SCORE]
    found: FloatArray = second @ layers.last + whole @ layers.direct + layers.score * score
    return found


def scaled_lines(numbers: FloatArray, matched: BoolArray, of_lines: FloatArray) -> FloatArray:
    """Return the numbers of lines as layers take them; the first says whether there is a line."""
    lines = within(numbers, of_lines) * matched[:, :, None]
    lines[:, :, 0] = matched
    return lines


def place_numbers(known: Described, bare: Layers, values: FloatArray) -> FloatArray:
    """Return what says whether a sketch shows a place at all, shape (64,).

    Decoys are what the sketch is not: mirrored, or with things in each other's places. The best
    that they achieve on the map is what chance achieves there. Of decoys nothing but places, sizes
    and shapes is known, so these alone are compared.

    Parameters
    ----------
    known
        The maps.
    bare
        What maps are worth without relations.
    values
        Shape (c,): what maps are worth by all that is known.
    """
    measured, maps = known.measured, known.maps
    best = int(values.argmax())
    top = float(worths(known, measured, bare, related=False).max())
    chance = [
        float(worths(known, each, bare, related=False).max())
        for each in known.decoys
        if len(each.lines)
    ] or [top + _NONE]
    shared = ((maps == maps[best]) & (maps[best] >= 0)).sum(axis=1)
    other = shared <= max(1, int(measured.matched[best].sum()) // 4)
    rival = float(values[other].max()) if other.any() else float(values.min()) - 4.0
    most, mean = top - max(chance), top - float(np.mean(chance))
    lead = float(values[best]) - rival
    at_first = measured.wholes[:, Whole.SCORE]
    first = float(at_first.max())
    by_chance = [float(each.wholes[:, Whole.SCORE].max(initial=_NONE)) for each in known.decoys]
    ahead = first - max(by_chance, default=first + _NONE)
    answer = measured.at(slice(best, best + 1))
    lines = line_numbers(answer, True)[answer.matched][:, 1:]
    if not len(lines):
        lines = np.zeros((1, lines.shape[1]))
    if not known.related:
        lines[:, _UNRELATED - 1 :] = 0.0
    count, few = known.drawn, min(known.drawn, _MOST_DRAWN)
    offset, bend, matched, missing, crowd = map_numbers(answer, count)[0, :5]
    return np.array(
        [
            *scene_numbers(known),
            known.related,
            *(each / count * scale for each in (most, mean, lead, ahead) for scale in (1.0, few)),
            first / count,
            matched / count,
            missing / count,
            crowd / count,
            offset,
            bend,
            *lines.mean(axis=0),
            *lines.max(axis=0),
        ]
    )


def weighed(known: Described, learned: Posterior, elsewhere: float | None = None) -> Weighed:
    """Return what the numbers of maps come to.

    Parameters
    ----------
    known
        The maps.
    learned
        What was learned.
    elsewhere
        How likely the sketch does not show this place, where that is known.
    """
    values = worths(known, known.measured, learned.layers(known.related), known.related)
    labels = known.measured.wholes[:, [Whole.ALIKE, Whole.UNLIKE]] @ learned.labels
    shares = np.exp(values + labels - (values + labels).max())
    shares /= shares.sum()
    lost = float(lost_numbers(known, shares, float(values.max())) @ learned.lost)
    if elsewhere is None:
        elsewhere = _elsewhere(known, learned, values)
    return Weighed(shares, _logistic(lost), elsewhere)


def _elsewhere(known: Described, learned: Posterior, values: FloatArray) -> float:
    """Return how likely a sketch does not show the place of a map."""
    layers = learned.place
    numbers = within(place_numbers(known, learned.bare, values), layers.of_places)
    hidden = np.maximum(numbers @ layers.first + layers.first_bias, 0.0)
    here = float(hidden @ layers.last + numbers @ layers.direct) + layers.constant
    return _logistic(-here)


def lost_numbers(known: Described, shares: FloatArray, best: float) -> FloatArray:
    """Return what says whether the right map is among those that are known, shape (6,).

    Parameters
    ----------
    known
        The maps.
    shares
        How likely each is right if one of them is.
    best
        What the best is worth: where the right one is not known, none fits well.
    """
    drawn, mapped = known.drawn, known.mapped
    few = min(drawn, _MOST_DRAWN)
    return np.array(
        [1.0, few, math.log(mapped), math.log(shares.max()), drawn / mapped, best / drawn]
    )


def within(numbers: FloatArray, scaling: FloatArray) -> FloatArray:
    """Return numbers in units of what was learned from, and not far beyond it.

    Parameters
    ----------
    numbers
        Shape (…, k).
    scaling
        Shape (2, k): middle and scale.
    """
    middle, scale = scaling
    bounded: FloatArray = np.clip((numbers - middle) / scale, -FARTHEST, FARTHEST)
    return bounded


def _logistic(odds: float) -> float:
    return float(1.0 / (1.0 + math.exp(-min(max(odds, -50.0), 50.0))))
