"""The maps of a sketch in numbers, and those of its decoys: what is judged, and learned from."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from sketchmatch.model import FloatArray, IntArray, RelationTable, Scene
from sketchmatch_builtin.alignment import (
    Sides,
    Things,
    known_maps,
    measured,
    refined_maps,
    relations_of,
)
from sketchmatch_builtin.judges._evidence import Described, numbers

__all__ = ["Described", "described"]

_DECOY_POSES, _DECOY_GUESSES = 30, 8_000
_SEED = 0


def described(
    scenes: tuple[Scene, Scene],
    sides: Sides,
    table: RelationTable,
    names: IntArray | None = None,
    met: Iterable[IntArray] = (),
    partial: bool = True,
) -> Described:
    """Describe maps of a sketch, and of its decoys.

    Parameters
    ----------
    scenes, sides
        The sketch and the map.
    table, names
        Of template and argument, as in :class:`sketchmatch.api.JudgeProblem`.
    met
        Maps that are known, of the sketch.
    partial
        Whether objects of both sides may be without partner.
    """
    found = [*met, *(each.partners for each in known_maps(sides, partial=partial))]
    unique = {each.tobytes(): each for each in found}
    maps = np.stack([*unique.values()])
    relations = relations_of(scenes, table, names, sides.swapped)
    drawn, mapped = len(sides.drawn.places), len(sides.mapped.places)
    parts = measured(maps, sides.drawn, sides.mapped, relations)
    decoys = tuple(_decoy_numbers(each, sides.mapped) for each in _decoys(sides.drawn))
    return Described(maps, numbers(parts, drawn, mapped), decoys, drawn, mapped)


def _decoys(drawn: Things) -> Iterator[Things]:
    """Yield what the sketch is not, and might be as likely where it shows another place."""
    rng = np.random.default_rng(_SEED)
    mirrored = drawn._replace(places=np.conj(drawn.places), shapes=np.conj(drawn.shapes))
    yield mirrored
    for each in (drawn, mirrored, drawn):
        order = _derangement(rng, len(each.sizes))
        yield each._replace(sizes=each.sizes[order], shapes=each.shapes[order])


def _derangement(rng: np.random.Generator, count: int) -> IntArray:
    """Return a random order in which nothing is where it was."""
    while True:
        order = rng.permutation(count)
        if (order != np.arange(count)).all():
            return order


def _decoy_numbers(decoy: Things, mapped: Things) -> FloatArray:
    """Return the numbers of the best maps of a decoy; of none, where it fits nowhere."""
    drawn, there_are = len(decoy.places), len(mapped.places)
    sides = Sides(decoy, mapped, np.zeros((drawn, there_are)), swapped=False)
    laid = refined_maps(sides, _DECOY_POSES, _DECOY_GUESSES)
    maps = np.array([each.partners for each in laid], dtype=np.int64).reshape(-1, drawn)
    return numbers(measured(maps, decoy, mapped), drawn, there_are)
