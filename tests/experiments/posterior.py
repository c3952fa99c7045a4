"""What the judge ``posterior`` goes by, learned from sketches of several kinds.

Three fits, each with a small penalty: which of the maps that are known is right, by a conditional
logit; whether it is among them; and whether the sketch shows the place at all. Labels are evidence
on their own, so what they count for is learned from labels put on the same sketches.
"""

from __future__ import annotations

import itertools
import json
import pickle
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from sketchmatch.model import BoolArray, FloatArray, IntArray
from sketchmatch.pipeline.engine import Engine
from sketchmatch.pipeline.slices import finish
from sketchmatch.registry import default_registry
from sketchmatch_builtin.alignment import Measured, Whole, sides_of
from sketchmatch_builtin.histograms.constant import ConstantForce
from sketchmatch_builtin.judges._described import described
from sketchmatch_builtin.judges._evidence import (
    Described,
    line_numbers,
    lost_numbers,
    map_numbers,
    place_numbers,
    scene_numbers,
    weighed,
    worths,
)
from sketchmatch_builtin.judges.calibration import Layers, PlaceLayers, Posterior
from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation
from tests.experiments.drawings import Drawing
from tests.experiments.logits import log_shares, significant
from tests.experiments.networks import Case, fitted_maps, fitted_place
from tests.experiments.reliability import reliability
from tests.experiments.training import training_drawing

__all__ = [
    "Known",
    "judged_errors",
    "knowing",
    "known_of",
    "known_sketches",
    "learned_posterior",
    "posterior_text",
]

_ENGINE = Engine(default_registry())

_SEEDS = {True: 1, False: 0}
"""Of the fits of maps, with relations and without: of two, that with which more of the strangers
were right, when as many maps were weighed as are learned from."""

_WEIGHED, _BEYOND = 40, 300
"""Maps that are compared with the right one where it is among these, those that fit best; and where
it is not. From a right one farther down nothing is learned of maps: those before it are mostly
better by luck, and who learns from them knows the others less well."""

_PENALTY = 1e-4
_UNRELATED = 0.3
"""How many sketches are learned from as if nothing were known of relations."""

_OTHER_PLACES = 10.0
"""What a sketch of another place counts for: taking it for this one is the worse mistake."""

_SHIFTS = -4.0, 4.0
"""How far the odds of the right map's not being known may be shifted."""

_SHARPER = 0.5, 2.0
"""How much more, or less, what speaks for maps may count than was learned."""

_LABELLED, _RIGHTLY, _WORDS = 0.7, 0.9, 0.5
"""How many objects have a label, how many of these the right one, and how many words there are for
an object of the map, where labels are learned."""


@dataclass(frozen=True, eq=False)
class Known:
    """A sketch to learn from.

    Attributes
    ----------
    described
        Its maps in numbers; without the right one where that was not found.
    right
        Index of the right map; −1 where it is none of them.
    elsewhere
        Whether the sketch is of another place.
    truth
        Map index or −1 by sketched object.
    """

    described: Described
    right: int
    elsewhere: bool
    truth: IntArray


def known_of(number: int, draw: Callable[[int], Drawing] = training_drawing) -> list[Known]:
    """Return a sketch in numbers: the one of that number, of a kind that somebody draws."""
    drawn = draw(number)
    scenes = drawn.scene, drawn.map
    compared = finish(_ENGINE.compare(scenes, ConstantForce(), CrossCorrelation()))
    swapped = compared.swapped
    sides = sides_of(scenes[::-1] if swapped else scenes, swapped, None, None, None)
    try:
        found = described(scenes, sides, compared.table)
    except ValueError:  # nothing fits at all
        return []
    found = replace(
        found,
        measured=_in_half_the_room(found.measured),
        decoys=tuple(map(_in_half_the_room, found.decoys)),
    )
    right = np.flatnonzero((found.maps == drawn.truth).all(axis=1))
    elsewhere = bool((drawn.truth < 0).all())
    return [Known(found, int(right[0]) if len(right) else -1, elsewhere, drawn.truth)]


def known_sketches(
    name: str,
    draw: Callable[[int], Drawing],
    numbers: range,
    kept: Path | None = None,
) -> list[Known]:
    """Return sketches of a kind in numbers.

    Parameters
    ----------
    name
        Of the kind.
    draw
        As for :func:`known_of`.
    numbers
        Which ones.
    kept
        A folder for them: those that are there are read.
    """
    file = kept / f"{name}-{numbers.start}-{numbers.stop}.pickle" if kept else None
    if file and file.exists():
        found: list[Known] = pickle.loads(file.read_bytes())
        return found
    every = [known_of(number, draw) for number in numbers]
    found = list(itertools.chain.from_iterable(every))
    if file:
        file.write_bytes(pickle.dumps(found))
    return found


def _in_half_the_room(measured: Measured) -> Measured:
    lines, wholes = (each.astype(np.float32) for each in (measured.lines, measured.wholes))
    return Measured(lines, wholes, measured.matched)


def learned_posterior(cases: Sequence[Known], others: Sequence[Known]) -> Posterior:
    """Return what makes the truth likeliest.

    Parameters
    ----------
    cases
        Sketches of this place and of others.
    others
        Sketches of this place of another kind: of these as many right maps are not known as is
        expected, and as sure may be who tells the others.
    """
    told = _some_unrelated(cases)
    met = _met(told)
    # Places are told by what is known of decoys as well, which is nothing of relations.
    maps, bare = (
        _rounded_layers(
            _as_sharp_as_for(
                _met(others),
                fitted_maps([_case(each, related) for each in met], _SEEDS[related]),
                related,
            )
        )
        for related in (True, False)
    )
    every = _valued(told, maps, bare)
    here = [each for each in every if not each.known.elsewhere]
    luck = [
        float((each.known.described.maps[each.values.argmax()] == each.known.truth).mean())
        for each in here
        if each.known.right < 0
    ]
    place = _rounded_place(
        fitted_place(
            np.array([place_numbers(each.known.described, bare, each.values) for each in every]),
            np.array([not each.elsewhere for each in told]),
            np.array([_OTHER_PLACES if _counts(each) else 1.0 for each in told]),
        )
    )
    checked = _valued(_some_unrelated([each for each in others if not each.elsewhere]), maps, bare)
    return Posterior(
        maps,
        bare,
        place,
        _rounded(_labels([each for each in here if each.known.right >= 0])),
        _rounded(_lost(here, checked)),
        round(float(np.mean(luck)), 2),
    )


def _as_sharp_as_for(others: Sequence[Known], layers: Layers, related: bool) -> Layers:
    """Return layers that tell right maps from wrong ones as surely as they do for others.

    Who learns from many kinds of people is less sure of each than one of these deserves.
    """
    found = [
        (worths(each.described, each.described.measured, layers, related), each.right)
        for each in others
    ]

    def loss(by: float) -> float:
        return -float(np.mean([log_shares(by * values[None])[0, k] for values, k in found]))

    by = float(minimize_scalar(loss, bounds=_SHARPER, method="bounded").x)
    last, direct, score = by * layers.last, by * layers.direct, by * layers.score
    return layers._replace(last=last, direct=direct, score=score)


def _met(cases: Sequence[Known]) -> list[Known]:
    """Return the sketches from which maps are learned."""
    return [each for each in cases if 0 <= each.right < _BEYOND]


class _Valued(NamedTuple):
    """A sketch, and what its maps are worth."""

    known: Known
    values: FloatArray


def _valued(cases: Sequence[Known], maps: Layers, bare: Layers) -> list[_Valued]:
    found = []
    for each in cases:
        of = each.described
        values = worths(of, of.measured, maps if of.related else bare, of.related)
        found.append(_Valued(each, values))
    return found


def _lost(cases: Sequence[_Valued], others: Sequence[_Valued]) -> FloatArray:
    """Return the weights of how likely the right map is not known.

    Where that is likely is learned from all, and how often it is so from the others.
    """
    lost = _logit(_lost_numbers(cases), _unknown(cases), np.ones(len(cases)))
    odds, unknown = _lost_numbers(others) @ lost, _unknown(others)

    def loss(shift: float) -> float:
        return float((np.logaddexp(0.0, odds + shift) - unknown * (odds + shift)).mean())

    lost[0] += minimize_scalar(loss, bounds=_SHIFTS, method="bounded").x
    return lost


def knowing(first: Posterior, cases: Sequence[Known]) -> Posterior:
    """Return what was learned first, gone on with until nothing of it need be left.

    Parameters
    ----------
    first
        What to go on from.
    cases
        Sketches of this place and of others, of the kinds that are to be judged.
    """
    maps = fitted_maps([_case(each, True) for each in _met(cases)], start=first.maps)
    every = _valued(cases, maps, first.bare)
    place = fitted_place(
        np.array([place_numbers(each.known.described, first.bare, each.values) for each in every]),
        np.array([not each.elsewhere for each in cases]),
        np.ones(len(cases)),
        start=first.place,
    )
    here = [each for each in every if not each.known.elsewhere]
    lost = _logit(_lost_numbers(here), _unknown(here), np.ones(len(here)))
    return first._replace(maps=maps, place=place, lost=lost)


def judged_errors(cases: Sequence[Known], learned: Posterior) -> dict[str, float]:
    """Return how well the probabilities hold: expected calibration errors, and shares.

    Of maps and of places, how many answers are wholly right, how many right ones are among those
    known, and how many sketches of this place and of others are taken for what they are not.
    """
    maps, places = [], []
    for case in cases:
        known = case.described
        found = weighed(known, learned)
        best, here = int(found.shares.argmax()), 1.0 - found.elsewhere
        right = best == case.right and not case.elsewhere
        maps.append((here * (1.0 - found.lost) * float(found.shares[best]), right))
        places.append((here, not case.elsewhere))
    ours = [case for case in cases if not case.elsewhere]
    rights = [right for (_, right), case in zip(maps, cases, strict=True) if not case.elsewhere]
    return {
        "maps": significant(reliability(maps).error, 2),
        "places": significant(reliability(places).error, 2),
        "right": significant(float(np.mean(rights)), 3),
        "known": significant(float(np.mean([case.right >= 0 for case in ours])), 3),
        "refused": significant(float(np.mean([here < 0.5 for here, ours in places if ours])), 2),
        "accepted": significant(
            float(np.mean([here > 0.5 for here, ours in places if not ours])), 2
        ),
    }


def _some_unrelated(cases: Sequence[Known]) -> list[Known]:
    """Return sketches, of some of which no relations are known."""
    rng = np.random.default_rng(0)
    return [
        replace(each, described=replace(each.described, related=False))
        if rng.random() < _UNRELATED
        else each
        for each in cases
    ]


def _lost_numbers(cases: Sequence[_Valued]) -> FloatArray:
    return np.array(
        [
            lost_numbers(known.described, _shares(values), float(values.max()))
            for known, values in cases
        ]
    )


def _unknown(cases: Sequence[_Valued]) -> FloatArray:
    return np.array([each.known.right < 0 for each in cases], dtype=float)


def _counts(case: Known) -> bool:
    """Whether a sketch of another place shows enough to be told from one of this place."""
    return case.elsewhere and case.described.drawn > 5


def _case(known: Known, related: bool) -> Case:
    """Return a sketch as the fit of maps wants it."""
    found = known.described
    measured = found.measured.at(slice(_WEIGHED if known.right < _WEIGHED else _BEYOND))
    return Case(
        line_numbers(measured, related).astype(np.float32),
        measured.matched,
        map_numbers(measured, found.drawn),
        scene_numbers(found),
        measured.wholes[:, Whole.SCORE],
        known.right,
    )


def _labels(cases: Sequence[_Valued]) -> FloatArray:
    """Return what labels count for that mean the same, and that do not."""
    rng = np.random.default_rng(0)
    rows = []
    for each, _ in cases:
        names = _named(each, rng)
        lines = np.arange(len(each.truth))
        told = np.where(each.described.maps >= 0, names[lines, each.described.maps], 0)
        rows.append(np.column_stack([(told > 0).sum(axis=1), (told < 0).sum(axis=1)]).astype(float))
    rights = np.array([each.known.right for each in cases])
    return _conditional(rows, rights, [each.values for each in cases])


def _named(case: Known, rng: np.random.Generator) -> IntArray:
    """Return which labels mean the same, as in ``JudgeProblem.names``, of a sketch and a map."""
    words = max(2, round(_WORDS * case.described.mapped))
    mapped = rng.integers(words, size=case.described.mapped)
    drawn = np.where(case.truth >= 0, mapped[case.truth], rng.integers(words, size=len(case.truth)))
    mistaken = rng.random(len(drawn)) > _RIGHTLY
    drawn = np.where(mistaken, rng.integers(words, size=len(drawn)), drawn)
    names = np.where(drawn[:, None] == mapped, 1, -1)
    names[rng.random(len(drawn)) > _LABELLED] = 0
    names[:, rng.random(len(mapped)) > _LABELLED] = 0
    return names


def _conditional(
    rows: Sequence[FloatArray], rights: IntArray, offsets: Sequence[FloatArray]
) -> FloatArray:
    """Return the weights under which the right rows are likeliest, beside what speaks for them."""
    x, none, beside = _padded(rows, offsets)
    unit = np.abs(x[~none]).mean(axis=0) + 1e-9
    x, cases = x / unit, np.arange(len(rights))

    def loss(weights: FloatArray) -> tuple[float, FloatArray]:
        scores = np.where(none, -np.inf, x @ weights + beside)
        scores -= scores.max(axis=1, keepdims=True)
        shares = np.exp(scores)
        shares /= shares.sum(axis=1, keepdims=True)
        value = -np.log(np.maximum(shares[cases, rights], 1e-300)).mean()
        shares[cases, rights] -= 1.0
        slope = np.einsum("cm,cmp->p", shares, x) / len(cases)
        return float(value + _PENALTY * weights @ weights), slope + 2.0 * _PENALTY * weights

    found = minimize(loss, np.zeros(x.shape[2]), jac=True, method="L-BFGS-B", options=_PATIENT)
    fitted: FloatArray = found.x / unit
    return fitted


_PATIENT = {"maxiter": 1000}


def _padded(
    rows: Sequence[FloatArray], offsets: Sequence[FloatArray]
) -> tuple[FloatArray, BoolArray, FloatArray]:
    most = max(map(len, rows))
    x = np.zeros((len(rows), most, rows[0].shape[1]))
    none, beside = np.ones(x.shape[:2], dtype=bool), np.zeros(x.shape[:2])
    for k, each in enumerate(rows):
        x[k, : len(each)], none[k, : len(each)], beside[k, : len(each)] = each, False, offsets[k]
    return x, none, beside


def _logit(x: FloatArray, truth: FloatArray, counts: FloatArray) -> FloatArray:
    """Return the weights under which the truth is likeliest."""
    unit = np.abs(x).mean(axis=0) + 1e-9
    x, counts = x / unit, counts / counts.mean()

    def loss(weights: FloatArray) -> tuple[float, FloatArray]:
        odds = x @ weights
        value = (counts * (np.logaddexp(0.0, odds) - truth * odds)).mean()
        slope = x.T @ (counts * (1.0 / (1.0 + np.exp(-odds)) - truth)) / len(truth)
        return float(value + _PENALTY * weights @ weights), slope + 2.0 * _PENALTY * weights

    found = minimize(loss, np.zeros(x.shape[1]), jac=True, method="L-BFGS-B", options=_PATIENT)
    fitted: FloatArray = found.x / unit
    return fitted


def _shares(scores: FloatArray) -> FloatArray:
    shares: FloatArray = np.exp(scores - scores.max())
    return shares / shares.sum()


def _rounded(values: FloatArray) -> FloatArray:
    """Return values to four digits, as they are written."""
    rounded: FloatArray = np.vectorize(lambda each: float(f"{each:.4g}"))(values)
    return rounded


def _rounded_layers(layers: Layers) -> Layers:
    *arrays, score = layers
    return Layers(*map(_rounded, arrays), significant(score, 4))


def _rounded_place(layers: PlaceLayers) -> PlaceLayers:
    *arrays, constant = layers
    return PlaceLayers(*map(_rounded, arrays), significant(constant, 4))


def posterior_text(learned: Posterior) -> str:
    """Return what was learned as JSON, a row of numbers on each line."""
    parts = {
        name: {key: np.asarray(value).tolist() for key, value in layers._asdict().items()}
        for name, layers in (
            ("maps", learned.maps),
            ("bare", learned.bare),
            ("place", learned.place),
        )
    }
    beside = {"labels": learned.labels.tolist(), "lost": learned.lost.tolist()}
    text = json.dumps(parts | beside | {"luck": learned.luck}, indent=1)
    return re.sub(r"\[\s+(-?[\d.e\-+]+(?:,\s+-?[\d.e\-+]+)*)\s+\]", _in_one_line, text) + "\n"


def _in_one_line(found: re.Match[str]) -> str:
    return "[" + re.sub(r",\s+", ", ", found[1]) + "]"
