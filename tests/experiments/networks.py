"""Fits of the two small networks that the judge ``posterior`` goes by.

Gradients are written out: the networks are of one hidden layer for lines, one for maps and one for
places, and nothing else here needs a library for such.

References
----------
D. Kingma, J. Ba, "Adam: a method for stochastic optimization", 2015.
I. Loshchilov, F. Hutter, "Decoupled weight decay regularization", ICLR 2019.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from sketchmatch.model import BoolArray, FloatArray, IntArray
from sketchmatch_builtin.judges._evidence import AT_FIRST, LINES, scaled_lines, within
from sketchmatch_builtin.judges.calibration import Layers, PlaceLayers

__all__ = ["Case", "fitted_maps", "fitted_place"]

_WIDTH = 64
_PLACE_WIDTH = 16
_EPOCHS = 20
_BATCH = 64
_RATE = 2e-3
_WARMING = 0.05
_DECAY, _PLACE_DECAY = 0.5, 0.1
_MOMENTS = 0.9, 0.995

_SCALED_BY = 4000
"""Cases of which the scales of numbers are taken."""

_Parameters: TypeAlias = dict[str, FloatArray]
_Slopes: TypeAlias = Callable[[_Parameters, IntArray], _Parameters]


class Case(NamedTuple):
    """The maps of a sketch.

    Attributes
    ----------
    lines
        Shape (c, n, k): the numbers of lines.
    matched
        Shape (c, n).
    whole, scene
        Shape (c, 8) and (3,): the numbers of maps and of scenes.
    score
        Shape (c,): of the alignments.
    right
        Index of the right map.
    """

    lines: FloatArray
    matched: BoolArray
    whole: FloatArray
    scene: FloatArray
    score: FloatArray
    right: int


def fitted_maps(cases: Sequence[Case], seed: int = 0, start: Layers | None = None) -> Layers:
    """Return the layers under which the right maps are likeliest.

    Parameters
    ----------
    cases
        What to learn from.
    seed
        Of what is random.
    start
        Layers to go on from, of which nothing need be left.
    """
    rng = np.random.default_rng(seed)
    if start is None:
        some = [cases[k] for k in rng.permutation(len(cases))[:_SCALED_BY]]
        of_lines = _scaling(np.concatenate([each.lines[each.matched] for each in some]))
        of_maps = _scaling(np.concatenate([each.whole for each in some]))
        of_scenes = _scaling(np.stack([each.scene for each in some]))
    else:
        of_lines, of_maps, of_scenes = start.of_lines, start.of_maps, start.of_scenes
    known = [_small(each, of_lines, of_maps, of_scenes) for each in cases]
    k, w, s = (one.shape[1] for one in (of_lines, of_maps, of_scenes))
    parameters = {
        "first": _random(rng, k + s, _WIDTH),
        "first_bias": np.zeros(_WIDTH),
        "second": _random(rng, w + s + _WIDTH, _WIDTH),
        "second_bias": np.zeros(_WIDTH),
        "last": np.zeros(_WIDTH),
        "direct": np.zeros(w),
        "score": np.ones(1),
    }
    if start is not None:
        parameters = {name: np.array(getattr(start, name), ndmin=1) for name in parameters}

    def slopes(at: _Parameters, chosen: IntArray) -> _Parameters:
        small = {name: each.astype(np.float32) for name, each in at.items()}
        return _map_slopes(small, [known[c] for c in chosen])

    _descend(parameters, slopes, len(cases), rng, _DECAY, keep=("score",))
    score = float(parameters.pop("score")[0])
    return Layers(of_lines, of_maps, of_scenes, score=score, **parameters)


def fitted_place(
    rows: FloatArray,
    here: BoolArray,
    counts: FloatArray,
    seed: int = 0,
    start: PlaceLayers | None = None,
) -> PlaceLayers:
    """Return the layers under which it is likeliest which sketches show their place.

    Parameters
    ----------
    rows
        Shape (c, k): the numbers of places.
    here
        Shape (c,).
    counts
        Shape (c,): what each sketch counts for.
    start
        Layers to go on from, of which nothing need be left.
    """
    rng = np.random.default_rng(seed)
    of_places = _scaling(rows) if start is None else start.of_places
    x, counts = within(rows, of_places), counts / counts.mean()
    parameters = {
        "first": _random(rng, x.shape[1], _PLACE_WIDTH),
        "first_bias": np.zeros(_PLACE_WIDTH),
        "last": np.zeros(_PLACE_WIDTH),
        "direct": np.zeros(x.shape[1]),
        "constant": np.zeros(1),
    }
    if start is not None:
        parameters = {name: np.array(getattr(start, name), ndmin=1) for name in parameters}

    def slopes(at: _Parameters, chosen: IntArray) -> _Parameters:
        z = x[chosen]
        hidden = np.maximum(z @ at["first"] + at["first_bias"], 0.0)
        odds = hidden @ at["last"] + z @ at["direct"] + at["constant"]
        off = counts[chosen] * (1.0 / (1.0 + np.exp(-odds)) - here[chosen]) / len(chosen)
        back = np.outer(off, at["last"]) * (hidden > 0.0)
        return {
            "first": z.T @ back,
            "first_bias": back.sum(axis=0),
            "last": hidden.T @ off,
            "direct": z.T @ off,
            "constant": off.sum(keepdims=True),
        }

    _descend(parameters, slopes, len(x), rng, _PLACE_DECAY, keep=("constant",))
    constant = float(parameters.pop("constant")[0])
    return PlaceLayers(of_places, constant=constant, **parameters)


def _map_slopes(at: _Parameters, cases: Sequence[Case]) -> _Parameters:
    """Return the slopes of −ln of how likely the right maps are, in the mean."""
    counts = np.array([len(each.whole) for each in cases])
    case = np.repeat(np.arange(len(cases)), counts)
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    scenes = np.stack([each.scene for each in cases])[case]
    whole = np.concatenate([each.whole for each in cases])
    score = np.concatenate([each.score for each in cases])
    objects = np.repeat([each.lines.shape[1] for each in cases], counts)
    every = np.concatenate([each.lines.reshape(-1, each.lines.shape[2]) for each in cases])
    of = np.repeat(np.arange(len(case)), objects)
    every = np.hstack([every, scenes[of]])
    hidden = np.maximum(every @ at["first"] + at["first_bias"], 0.0)
    begins = np.concatenate([[0], np.cumsum(objects)[:-1]])
    summed = LINES * np.add.reduceat(hidden, begins, axis=0)
    among = np.hstack([whole, scenes, summed])
    second = np.maximum(among @ at["second"] + at["second_bias"], 0.0)
    worths = second @ at["last"] + whole @ at["direct"] + at["score"] * score
    shares = np.exp(worths - np.maximum.reduceat(worths, starts)[case])
    off = shares / np.add.reduceat(shares, starts)[case]
    off[starts + [each.right for each in cases]] -= 1.0
    off /= len(cases)
    back = np.outer(off, at["last"]) * (second > 0.0)
    lower = LINES * (back @ at["second"].T)[:, -hidden.shape[1] :]
    lower = lower[of] * (hidden > 0.0)
    return {
        "first": every.T @ lower,
        "first_bias": lower.sum(axis=0),
        "second": among.T @ back,
        "second_bias": back.sum(axis=0),
        "last": second.T @ off,
        "direct": whole.T @ off,
        "score": (off @ score)[None],
    }


def _small(case: Case, of_lines: FloatArray, of_maps: FloatArray, of_scenes: FloatArray) -> Case:
    """Return a case in numbers as the layers see them, in half the room."""
    lines = scaled_lines(case.lines, case.matched, of_lines)
    parts = lines, within(case.whole, of_maps), within(case.scene, of_scenes)
    lines, whole, scene = (each.astype(np.float32) for each in parts)
    score = (AT_FIRST * case.score).astype(np.float32)
    return case._replace(lines=lines, whole=whole, scene=scene, score=score)


def _descend(
    parameters: _Parameters,
    slopes: _Slopes,
    cases: int,
    rng: np.random.Generator,
    decay: float,
    keep: Sequence[str],
) -> None:
    """Go down the slopes by Adam, with weights that decay but for some."""
    means = {name: np.zeros_like(each) for name, each in parameters.items()}
    squares = {name: np.zeros_like(each) for name, each in parameters.items()}
    steps, step = _EPOCHS * math.ceil(cases / _BATCH), 0
    for _ in range(_EPOCHS):
        order = rng.permutation(cases)
        for start in range(0, cases, _BATCH):
            share = step / steps
            rate = _RATE * min(1.0, 0.05 + share / _WARMING)
            rate *= 0.5 * (1.0 + math.cos(math.pi * share))
            step += 1
            for name, slope in slopes(parameters, order[start : start + _BATCH]).items():
                mean, square, value = means[name], squares[name], parameters[name]
                mean += (1.0 - _MOMENTS[0]) * (slope - mean)
                square += (1.0 - _MOMENTS[1]) * (slope**2 - square)
                size = np.sqrt(square / (1.0 - _MOMENTS[1] ** step)) + 1e-7
                value -= rate * (mean / (1.0 - _MOMENTS[0] ** step) / size)
                if name not in keep:
                    value -= rate * decay * value


def _random(rng: np.random.Generator, rows: int, columns: int) -> FloatArray:
    return rng.normal(0.0, 1.0 / math.sqrt(rows), (rows, columns))


def _scaling(rows: FloatArray) -> FloatArray:
    """Return middle and scale of numbers, shape (2, k)."""
    return np.stack([rows.mean(axis=0), rows.std(axis=0) + 1e-5])
