"""Contracts of histograms."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator
from functools import cache, partial
from typing import Any

import numpy as np

from sketchmatch.api import Histogram
from sketchmatch.model import FloatArray, IntArray, Scene, SceneObject, object_pairs
from sketchmatch.model.arrays import sealed
from sketchmatch.testing.conformance.contract import Contract, require, require_applicable
from sketchmatch.testing.conformance.use import Use, contracts_of_use, view_within
from sketchmatch.testing.sketches import random_scene

__all__ = ["CONTRACTS"]

_CLOSE = 1e-6
"""By how much two values that should be equal may differ, as a share of the largest."""

_DIRECTIONS = 36


def rows_are_finite(algorithm: type[Any]) -> None:
    """Return finite float64 values, none below 0, in one row for each pair of objects."""
    rows = _described(algorithm)
    require(isinstance(rows, np.ndarray), f"describe() returned a {type(rows).__name__}")
    expected = (len(_pairs()), _DIRECTIONS)
    require(rows.shape == expected, f"the rows have shape {rows.shape}, not {expected}")
    require(rows.dtype == np.float64, f"the rows are of {rows.dtype}")
    require(np.isfinite(rows).all(), "a row holds values that are not finite")
    require(rows.min() >= 0.0, f"a row holds {rows.min():g}")


def rows_have_the_directions_asked_for(algorithm: type[Any]) -> None:
    """Return as many values a row as ``directions`` says; some are above 0 from 180 on."""
    for directions in (4, 180, 360):
        rows = _described(algorithm, directions=directions)
        require(rows.shape[1] == directions, f"of {directions} directions it gave {rows.shape[1]}")
        require(directions == 4 or rows.any(axis=1).all(), f"with {directions}, a row is all zero")


def directions_go_counter_clockwise(algorithm: type[Any]) -> None:
    """Say where a is from b: bin 0 is to the right, and a quarter of the bins on is above."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    for quarter, step in enumerate(([4.0, 0.0], [0.0, 4.0], [-4.0, 0.0], [0.0, -4.0])):
        scene = Scene.from_polygons([square + step, square])
        row = _of(algorithm).describe(scene, sealed(np.array([[0, 1]])))[0]
        angles = 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
        main = math.atan2(row @ np.sin(angles), row @ np.cos(angles))
        off = abs((main - quarter * np.pi / 2.0 + np.pi) % (2.0 * np.pi) - np.pi)
        where = ("right of", "above", "left of", "below")[quarter]
        require(off < 0.2, f"an object {where} another is {math.degrees(main):.0f}° from it")


def dual_is_turned_by_half(algorithm: type[Any]) -> None:
    """Give (b, a) the row of (a, b), turned by π."""
    backward = _described(algorithm, pairs=np.ascontiguousarray(_pairs()[:, ::-1]))
    _alike(np.roll(backward, _DIRECTIONS // 2, axis=1), _described(algorithm), "the two differ")


def rotation_shifts_the_rows(algorithm: type[Any]) -> None:
    """Shift the rows by as many bins as the scene is turned by."""
    for bins in (1, _DIRECTIONS // 4):
        angle = 2.0 * np.pi * bins / _DIRECTIONS
        turned = _described(algorithm, scene=_moved(angle=angle))
        shifted = np.roll(_described(algorithm), bins, axis=1)
        _alike(turned, shifted, f"turned by {math.degrees(angle):.0f}°, a row differs")


def scale_multiplies_the_rows(algorithm: type[Any]) -> None:
    """Multiply the rows by λ^(3−r) where the scene is scaled by λ; r is ``exponent``."""
    exponent = _of(algorithm).exponent
    require(
        isinstance(exponent, int | float) and math.isfinite(exponent), f"exponent is {exponent!r}"
    )
    for factor in (0.25, 3.0):
        scaled = _described(algorithm, scene=_moved(factor=factor)) * factor ** (exponent - 3.0)
        _alike(scaled, _described(algorithm), f"scaled by {factor:g}, r = {exponent:g}, it differs")


def translation_changes_nothing(algorithm: type[Any]) -> None:
    """Give the same rows wherever the scene lies."""
    moved = _described(algorithm, scene=_moved(step=(40.0, -70.0)))
    _alike(moved, _described(algorithm), "a row of a scene moved by (40, −70) differs")


def pairs_are_described_alone(algorithm: type[Any]) -> None:
    """Give a pair the same row whatever pairs come with it, in slices of any length."""
    whole = _described(algorithm)
    for size in (1, 4):
        parts = [
            _described(algorithm, pairs=_pairs()[k : k + size])
            for k in range(0, len(_pairs()), size)
        ]
        _alike(np.concatenate(parts), whole, f"described {size} at a time, a row differs")
    none = _described(algorithm, pairs=np.empty((0, 2), dtype=np.int64))
    require(none.shape == (0, _DIRECTIONS), f"of no pairs, the rows have shape {none.shape}")


def rows_of_pairs_last(algorithm: type[Any]) -> None:
    """With ``of_pairs``, keep the rows of two objects to the last digit while others change."""
    require_applicable(_of(algorithm).of_pairs, "it says of_pairs = False")
    square = np.array([[0.0, 0.0], [1.3, 0.0], [1.0, 1.1], [0.0, 1.0]])
    corners = [square + corner for corner in ((0.1, 0.0), (9.0, 0.3), (8.7, 7.0), (0.0, 6.8))]
    first, *others = (
        Scene.from_polygons([*corners, factor * square + 3.7]) for factor in (1.0, 0.6, 1.7)
    )
    pairs = object_pairs(len(corners))
    rows = _described(algorithm, scene=first, pairs=pairs)
    for other in others:
        changed = _described(algorithm, scene=other, pairs=pairs)
        require((rows == changed).all(), "it says of_pairs, and a row changed with another object")


def _uses() -> Iterator[Use]:
    for angle in (0.0, 1.0):
        scene, pairs = _moved(angle), view_within(_pairs())
        inputs = {"pairs": pairs}
        for k, item in enumerate(scene.objects):
            inputs |= {f"objects[{k}].rings[{n}]": ring for n, ring in enumerate(item.rings)}
        inputs |= {f"edges.{name}": array for name, array in scene.edges._asdict().items()}
        yield Use("a scene of 5 objects", inputs, partial(_answer, scene, pairs))


def _answer(scene: Scene, pairs: IntArray, histogram: Histogram) -> Hashable:
    return histogram.describe(scene, pairs).tobytes()


CONTRACTS: tuple[Contract, ...] = (
    rows_are_finite,
    rows_have_the_directions_asked_for,
    directions_go_counter_clockwise,
    dual_is_turned_by_half,
    rotation_shifts_the_rows,
    scale_multiplies_the_rows,
    translation_changes_nothing,
    pairs_are_described_alone,
    rows_of_pairs_last,
    *contracts_of_use(_uses, lambda algorithm: _of(algorithm, 180)),
)


@cache
def _scene() -> Scene:
    """Return objects that lie apart: hexagons, one with a notch, one with a hole."""
    notched = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]])
    frame = [[[0, 0], [3, 0], [3, 3], [0, 3]], [[1, 1], [1, 2], [2, 2], [2, 1]]]
    plain = random_scene(np.random.default_rng(5), 3).objects
    return Scene(
        (
            *plain,
            SceneObject.from_rings([notched + np.array([20.0, 2.0])]),
            SceneObject.from_rings([np.add(ring, (6.0, 21.0)) for ring in frame]),
        )
    )


def _pairs() -> IntArray:
    return object_pairs(len(_scene()))


def _moved(
    angle: float = 0.0, factor: float = 1.0, step: tuple[float, float] = (0.0, 0.0)
) -> Scene:
    c, s = factor * math.cos(angle), factor * math.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    return Scene(
        tuple(
            SceneObject.from_rings([ring @ turn + step for ring in item.rings])
            for item in _scene().objects
        )
    )


def _of(algorithm: type[Any], directions: int = _DIRECTIONS) -> Histogram:
    made: Histogram = algorithm(algorithm.Params(directions=directions))
    return made


def _described(
    algorithm: type[Any],
    *,
    scene: Scene | None = None,
    pairs: IntArray | None = None,
    directions: int = _DIRECTIONS,
) -> FloatArray:
    given = _pairs() if pairs is None else pairs
    return _of(algorithm, directions).describe(_scene() if scene is None else scene, sealed(given))


def _alike(rows: FloatArray, others: FloatArray, problem: str) -> None:
    """Require equal rows, each to a share of its own largest value."""
    require(rows.shape == others.shape, f"{problem}: shape {rows.shape}, not {others.shape}")
    off = np.abs(rows - others).max(axis=1) / others.max(axis=1)
    require((off <= _CLOSE).all(), f"{problem} by up to {off.max():.2g} of its largest value")
