"""The object maps that the best poses lead to."""

from __future__ import annotations

from collections.abc import Generator, Iterable
from dataclasses import dataclass

import numpy as np

from sketchmatch.model import IntArray
from sketchmatch_builtin.alignment._poses import (
    TOLERANCES,
    Guesses,
    empty_guesses,
    grid_of,
    guess_poses,
    guessed_pose,
    pairing_worths,
    refine_pose,
    vary,
)
from sketchmatch_builtin.alignment._sides import Sides
from sketchmatch_builtin.alignment._things import Things
from sketchmatch_builtin.searchers._assignment import FORBIDDEN, reduce_by_assignment

__all__ = ["Laid", "completed", "drive", "laid_maps", "template_maps"]

_ROOM = 400
_PAIRS = 30
_FLOOR = 0.8
"""Of what a pose is worth that fits nothing: what one must be above to be kept."""

_ROUGH = 3.5
"""λ while poses are guessed: less, so that fewer objects have to be looked at."""

_STEP = 2_000
"""Poses to weigh between two pauses, or a few more."""

_PAIRINGS = 100_000
"""Pairings to weigh for poses that are refined between two pauses, or a few more."""

_LOSS = 9.0
"""How much less than the best a map may be worth that changes make of others."""

_VARIED = 20
"""Maps that changes are made of."""

_CHANGES = 20_000
_FARTHEST = 20.0
_FEWEST = 3


@dataclass(frozen=True, eq=False)
class Laid:
    """A sketch laid upon a map.

    Attributes
    ----------
    partners
        int64, shape (n,): the mapped object of each sketched one, −1 for none.
    pose
        u, t, and by how much ln of the areas grows.
    score
        The sum of ℓ and −λ.
    """

    partners: IntArray
    pose: tuple[complex, complex, float]
    score: float


def laid_maps(
    sides: Sides, poses: int, maps: int, partial: bool
) -> Generator[int, None, list[Laid]]:
    """Lay a sketch upon a map in every way that may be right.

    Parameters
    ----------
    sides
        What is laid upon what.
    poses
        How many different maps to refine.
    maps
        How many to return at most.
    partial
        Whether objects of both sides may be without partner.

    Yields
    ------
    int
        How many poses were weighed.

    Returns
    -------
    list of Laid
        Different maps, what is worth most first.
    """
    guesses = yield from _guessed(sides)
    laid = yield from _refined(guesses, sides, poses)
    yield int(guesses.state[1])
    most = min(len(sides.drawn.places), len(sides.mapped.places))
    if not partial:
        laid = _ranked(_filled(each, sides) for each in laid)
    fewest = min(_FEWEST, most) if partial else most
    varied = _varied(laid, sides, maps)
    return [each for each in varied if np.count_nonzero(each.partners >= 0) >= fewest][:maps]


def drive(work: Generator[int, None, list[Laid]]) -> list[Laid]:
    """Go on with work to its end."""
    while True:
        try:
            next(work)
        except StopIteration as stop:
            found: list[Laid] = stop.value
            return found


def completed(laid: Laid | None, sides: Sides) -> IntArray:
    """Return the best map under a pose, or under none, that gives each template object a partner.

    Returns
    -------
    ndarray
        Shape (N,): for each template object.
    """
    worths = sides.bonus
    if laid is not None:
        worths = pairing_worths(*laid.pose, sides.drawn, sides.mapped, sides.bonus, TOLERANCES)
    if sides.swapped:
        worths = worths.T
    rows, columns = worths.shape
    costs, candidates = np.empty((rows, columns)), np.empty((rows, columns), dtype=np.int64)
    sizes, holders = np.empty(rows, dtype=np.int64), np.empty(columns, dtype=np.int64)
    for k, row in enumerate(worths):
        free = np.flatnonzero(np.isfinite(row))
        sizes[k] = len(free)
        candidates[k, : len(free)] = free
        costs[k, : len(free)] = np.minimum(row.max() - row[free], _FARTHEST)
    if reduce_by_assignment(costs, candidates, sizes, holders) >= FORBIDDEN:
        return np.arange(rows)
    found = np.empty(rows, dtype=np.int64)
    taken = np.flatnonzero(holders >= 0)
    found[holders[taken]] = taken
    return found


def template_maps(laid: Iterable[Laid], sides: Sides) -> list[IntArray]:
    """Return the maps, read from the template."""
    return [sides.template_partners(each.partners) for each in laid]


def _guessed(sides: Sides) -> Generator[int, None, Guesses]:
    """Weigh the poses that follow from two pairings each."""
    drawn, mapped = sides.drawn, sides.mapped
    rough = TOLERANCES._replace(omission=_ROUGH)
    guesses = empty_guesses(_ROOM, -_FLOOR * _ROUGH * len(drawn.places))
    grid = grid_of(mapped)
    pairs = _pairs(drawn)
    allowed = np.isfinite(sides.bonus).astype(np.float64)
    while guesses.state[2] < len(pairs) * len(mapped.places):
        guess_poses(pairs, drawn, mapped, grid, allowed, rough, _STEP, guesses)
        yield int(guesses.state[1])
    return guesses


def _refined(guesses: Guesses, sides: Sides, poses: int) -> Generator[int, None, list[Laid]]:
    """Return the different maps that the best guesses lead to."""
    drawn, mapped = sides.drawn, sides.mapped
    found: dict[bytes, Laid] = {}
    partners = np.empty(len(drawn.places), dtype=np.int64)
    count, weighed = int(guesses.state[0]), 0
    ranked = np.argsort(-guesses.scores[:count], kind="stable")
    for g in ranked[: 5 * poses]:
        pose = guessed_pose(guesses.pairings[g], drawn, mapped)
        u, t, growth, score = refine_pose(*pose, drawn, mapped, sides.bonus, TOLERANCES, partners)
        key = partners.tobytes()
        if key not in found or found[key].score < score:
            found[key] = Laid(partners.copy(), (u, t, growth), score)
        if len(found) >= poses:
            break
        weighed += sides.bonus.size
        if weighed >= _PAIRINGS:
            weighed = 0
            yield int(guesses.state[1])
    return sorted(found.values(), key=lambda laid: -laid.score)


def _filled(laid: Laid, sides: Sides) -> Laid:
    """Return a map under the same pose that gives each template object a partner."""
    partners = sides.drawn_partners(completed(laid, sides))
    worths = pairing_worths(*laid.pose, sides.drawn, sides.mapped, sides.bonus, TOLERANCES)
    matched = np.flatnonzero(partners >= 0)
    score = float(worths[matched, partners[matched]].sum())
    return Laid(partners, laid.pose, score - TOLERANCES.omission * (len(partners) - len(matched)))


def _ranked(laid: Iterable[Laid]) -> list[Laid]:
    """Return the different maps, each under its best pose, what is worth most first."""
    found: dict[bytes, Laid] = {}
    for each in laid:
        key = each.partners.tobytes()
        if key not in found or found[key].score < each.score:
            found[key] = each
    return sorted(found.values(), key=lambda each: -each.score)


def _varied(laid: list[Laid], sides: Sides, most: int) -> list[Laid]:
    """Return these maps and what single changes make of the best of them."""
    found = {each.partners.tobytes(): each for each in laid}
    maps = np.empty((_CHANGES, len(sides.drawn.places)), dtype=np.int64)
    losses = np.empty(_CHANGES)
    for each in laid[:_VARIED]:
        left = _LOSS - (laid[0].score - each.score)
        if left <= 0.0:
            break
        worths = pairing_worths(*each.pose, sides.drawn, sides.mapped, sides.bonus, TOLERANCES)
        count = vary(worths, TOLERANCES.omission, each.partners, left, maps, losses)
        for x in np.argsort(losses[:count], kind="stable")[:most]:
            key, score = maps[x].tobytes(), float(each.score - losses[x])
            if key not in found or found[key].score < score:
                found[key] = Laid(maps[x].copy(), each.pose, score)
    return sorted(found.values(), key=lambda each: -each.score)


def _pairs(drawn: Things) -> IntArray:
    """Return the sketched pairs to lay on others, far ones first: they fix a pose best."""
    n = len(drawn.places)
    a, b = np.triu_indices(n, k=1)
    pairs = np.stack([a, b], axis=1)
    most = max(_PAIRS, 2 * n)
    far = np.argsort(-np.abs(drawn.places[a] - drawn.places[b]), kind="stable")
    if len(pairs) > most:  # evenly over all distances
        far = far[np.linspace(0, len(pairs) - 1, most).astype(np.int64)]
    return np.ascontiguousarray(pairs[far].astype(np.int64))
