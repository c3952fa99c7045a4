"""The maps of a sketch in numbers, and those of its decoys: what is judged, and learned from."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from sketchmatch.model import IntArray, RelationTable, Scene
from sketchmatch_builtin.alignment import (
    Laid,
    Late,
    Measured,
    Sides,
    Things,
    known_maps,
    measured,
    never,
    refined_maps,
    relations_of,
)
from sketchmatch_builtin.judges._evidence import Described, best_first

__all__ = ["Described", "described"]

_DECOY_POSES, _DECOY_GUESSES = 10, 6_000
_SELF_GUESSES = 1_000
_SQUEEZED = 1.35
_SAME = -1.0
"""What a decoy is worth for each object, laid upon the sketch, that is the sketch again."""

_SEED = 0


def described(
    scenes: tuple[Scene, Scene],
    sides: Sides,
    table: RelationTable,
    names: IntArray | None = None,
    met: Iterable[IntArray] = (),
    partial: bool = True,
    related: bool = True,
    quick: bool = False,
    late: Late = never,
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
    related
        Whether relations are those that were learned from.
    quick
        Whether to go by the maps that are known alone, and by no decoys.
    late
        Once it is, there are fewer maps and decoys, but one of these.
    """
    laid = [] if quick else known_maps(sides, partial=partial, late=late)
    found = [*met, *(each.partners for each in laid)]
    unique = {each.tobytes(): each for each in found}
    maps = np.stack([*unique.values()])
    relations = relations_of(scenes, table, names, sides.swapped)
    known = measured(maps, sides.drawn, sides.mapped, relations)
    order = best_first(known)
    decoys = []
    for decoy in () if quick else _decoys(sides.drawn):
        decoys.append(_measured_decoy(decoy, sides.mapped))
        if late():
            break
    return Described(
        maps[order],
        known.at(order),
        tuple(decoys),
        len(sides.drawn.places),
        len(sides.mapped.places),
        related,
    )


def _decoys(drawn: Things) -> Iterator[Things]:
    """Yield what the sketch is not, and might be as likely where it shows another place.

    In the mirror, which keeps rows and corners; squeezed too; and with things in each other's
    places. One that is the sketch again, as where it shows a regular grid, is none.
    """
    rng = np.random.default_rng(_SEED)
    mirrored = drawn._replace(places=np.conj(drawn.places), shapes=np.conj(drawn.shapes))
    squeezed = [_squeezed(mirrored, by) for by in (_SQUEEZED, 1.0 / _SQUEEZED)]
    shuffled = []
    for each in (drawn, mirrored, drawn):
        order = _derangement(rng, len(each.sizes))
        shuffled.append(each._replace(sizes=each.sizes[order], shapes=each.shapes[order]))
    limit = _SAME * len(drawn.places)
    yield from (each for each in (mirrored, *squeezed, *shuffled) if _best(each, drawn) < limit)


def _squeezed(things: Things, by: float) -> Things:
    """Return things whose places are squeezed to their axis, or off it."""
    axis = np.exp(0.5j * np.angle((things.places**2).sum()))
    along = things.places / axis
    places = axis * (along.real * np.sqrt(by) + 1j * along.imag / np.sqrt(by))
    return things._replace(places=places)


def _derangement(rng: np.random.Generator, count: int) -> IntArray:
    """Return a random order in which nothing is where it was."""
    while True:
        order = rng.permutation(count)
        if (order != np.arange(count)).all():
            return order


def _best(decoy: Things, drawn: Things) -> float:
    """Return what a decoy is worth, laid upon the sketch that it is of."""
    laid = _laid(decoy, drawn, _SELF_GUESSES)
    return laid[0].score if laid else -np.inf


def _laid(decoy: Things, upon: Things, guesses: int = _DECOY_GUESSES) -> list[Laid]:
    bonus = np.zeros((len(decoy.places), len(upon.places)))
    return refined_maps(Sides(decoy, upon, bonus, swapped=False), _DECOY_POSES, guesses)


def _measured_decoy(decoy: Things, mapped: Things) -> Measured:
    """Return what speaks for the best maps of a decoy; of none, where it fits nowhere."""
    laid = [each.partners for each in _laid(decoy, mapped)]
    return measured(np.array(laid, dtype=np.int64).reshape(-1, len(decoy.places)), decoy, mapped)
