"""The object maps that the best poses lead to."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from sketchmatch.model import FloatArray, IntArray
from sketchmatch_builtin.alignment._poses import (
    TOLERANCES,
    Guesses,
    empty_guesses,
    far_pairs,
    fitting_pose,
    grid_of,
    guess_poses,
    pairing_worths,
    refine_guesses,
    refine_pose,
    vary,
)
from sketchmatch_builtin.alignment._sides import Sides
from sketchmatch_builtin.alignment._things import Things
from sketchmatch_builtin.searchers._assignment import FORBIDDEN, reduce_by_assignment

__all__ = [
    "Laid",
    "Late",
    "completed",
    "drive",
    "known_maps",
    "laid_maps",
    "near_maps",
    "never",
    "refined_maps",
    "template_maps",
]

GUESSES = 25_000
"""Poses to weigh; beyond, the pairs that were laid on others have met the right pose for sure."""

MAPS = 1_000
"""Maps to return at most: where somebody invents things, the right one may be beyond hundreds that
seem to fit better. Where few fit, few are returned."""

Late = Callable[[], bool]
"""Whether somebody waits for an answer already."""

_Value = TypeVar("_Value")

_FEWEST_PAIRS = 4
_ROOM = 400
_PAIRS = 30
_FLOOR = 0.8
"""Of what a pose is worth that fits nothing: what one must be above to be kept."""

_ROUGH = 3.5
"""λ while poses are guessed: less, so that fewer objects have to be looked at."""

_STEP = 16_000
"""Poses times sketched objects to weigh between two pauses, or a few more."""

_PAIRINGS = 100_000
"""Pairings to weigh for poses that are refined between two pauses, or a few more."""

_AT_ONCE = 16
"""Poses to refine at once: calls cost as much as the work, and the last ones may be in vain."""

_NEAR_PAIRS, _NEAR_POSES = 3, 10
"""Sketched pairs that are laid on all others, and maps that follow, beside those that are near."""

_LOSS = 9.0
"""How much less than the best a map may be worth that changes make of others."""

_VARIED = 20
"""Maps that changes are made of."""

_RECENT: deque[tuple[Any, list[Laid]]] = deque(maxlen=8)
"""What :func:`laid_maps` last returned, and for what: a searcher asks first, then a judge."""

_BEGUN: deque[tuple[Any, Guesses]] = deque(maxlen=8)
"""What :func:`laid_maps` had guessed where it was closed before its end, and for what."""

_CHANGES = 20_000
_FARTHEST = 20.0
_FEWEST = 3


def never() -> bool:
    """Return False: it is never late."""
    return False


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

    @property
    def lines(self) -> int:
        """How many objects have a partner."""
        return int(np.count_nonzero(self.partners >= 0))


def laid_maps(
    sides: Sides, poses: int = 60, maps: int = MAPS, partial: bool = True, guesses: int = GUESSES
) -> Generator[int, None, list[Laid]]:
    """Lay a sketch upon a map in every way that may be right.

    What comes of it is kept for :func:`known_maps`, also where it is closed before its end.

    Parameters
    ----------
    sides
        What is laid upon what.
    poses
        How many different maps to refine.
    maps
        How many to return at most, with what single changes make of the best.
    partial
        Whether objects of both sides may be without partner.
    guesses
        How many poses to weigh, or a few more: no more sketched pairs are laid on others then.

    Yields
    ------
    int
        How many poses were weighed.

    Returns
    -------
    list of Laid
        Different maps, what is worth most first.
    """
    key, guessed = (sides.identity, poses, maps, partial, guesses), _no_guesses(sides)
    try:
        laid = yield from _laid(sides, poses, guesses, guessed)
    except GeneratorExit:
        _BEGUN.appendleft((key, guessed))
        raise
    found = _found(laid, sides, maps, partial)
    _RECENT.appendleft((key, found))
    return found


def near_maps(
    sides: Sides, start: Iterable[IntArray], maps: int = 50, partial: bool = True
) -> list[Laid]:
    """Lay a sketch upon a map near maps that were right a moment ago, and in a few other ways.

    Parameters
    ----------
    sides, maps, partial
        As for :func:`laid_maps`.
    start
        Maps of the sketch.
    """
    guesses = _no_guesses(sides)
    drive(_guess(guesses, sides, 0, _NEAR_PAIRS))
    laid = drive(_refined(guesses, sides, _NEAR_POSES))
    partners = np.empty(len(sides.drawn.places), dtype=np.int64)
    for each in start:
        pose = fitting_pose(each, sides.drawn, sides.mapped)
        if pose is not None:
            u, t, growth, score = refine_pose(
                *pose, sides.drawn, sides.mapped, sides.bonus, TOLERANCES, partners
            )
            laid.append(Laid(partners.copy(), (u, t, growth), score))
    return _found(_ranked(laid), sides, maps, partial)


def _found(laid: list[Laid], sides: Sides, maps: int, partial: bool) -> list[Laid]:
    """Return maps, and what single changes make of the best, as far as they may be answers."""
    most = min(len(sides.drawn.places), len(sides.mapped.places))
    if not partial:
        laid = _ranked(_filled(each, sides) for each in laid)
    fewest = min(_FEWEST, most) if partial else most
    return [each for each in _varied(laid, sides, maps) if each.lines >= fewest]


def known_maps(
    sides: Sides,
    poses: int = 60,
    maps: int = MAPS,
    partial: bool = True,
    guesses: int = GUESSES,
    late: Late = never,
) -> list[Laid]:
    """Return what :func:`laid_maps` does, at once where a searcher asked for it just before.

    Once it is late, no more poses are weighed than were before, or than those of the fewest pairs,
    and few are refined.
    """
    key = (sides.identity, poses, maps, partial, guesses)
    for known, found in tuple(_RECENT):
        if known == key:
            return found
    begun = (each for known, each in tuple(_BEGUN) if known == key)
    guessed = deepcopy(next(begun, None)) or _no_guesses(sides)
    found = _found(drive(_laid(sides, poses, guesses, guessed, late)), sides, maps, partial)
    if not late():
        _RECENT.appendleft((key, found))
    return found


def refined_maps(sides: Sides, poses: int, guesses: int) -> list[Laid]:
    """Return the different maps that the best poses lead to, what is worth most first."""
    return drive(_laid(sides, poses, guesses, _no_guesses(sides)))


def _laid(
    sides: Sides, poses: int, most: int, guesses: Guesses, late: Late = never
) -> Generator[int, None, list[Laid]]:
    yield from _guess(guesses, sides, most, late=late)
    laid = yield from _refined(guesses, sides, poses, late)
    yield int(guesses.state[1])
    return laid


def drive(work: Generator[int, None, _Value]) -> _Value:
    """Go on with work to its end."""
    while True:
        try:
            next(work)
        except StopIteration as stop:
            found: _Value = stop.value
            return found


def completed(laid: Laid | None, sides: Sides) -> IntArray:
    """Return the best map under a pose, or under none, that gives each template object a partner.

    Returns
    -------
    ndarray
        Shape (N,): for each template object.
    """
    worths = sides.bonus if laid is None else _worths(laid, sides)
    if sides.swapped:
        worths = worths.T
    rows, columns = worths.shape
    costs, candidates = np.empty((rows, columns)), np.empty((rows, columns), dtype=np.int64)
    sizes, holders = np.empty(rows, dtype=np.int64), np.empty(columns, dtype=np.int64)
    if np.isfinite(worths).all():
        sizes[:], candidates[:] = columns, np.arange(columns)
        np.minimum(worths.max(axis=1, keepdims=True) - worths, _FARTHEST, out=costs)
    else:
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


def _worths(laid: Laid, sides: Sides) -> FloatArray:
    return pairing_worths(*laid.pose, sides.drawn, sides.mapped, sides.bonus, TOLERANCES)


def template_maps(laid: Iterable[Laid], sides: Sides) -> list[IntArray]:
    """Return the maps, read from the template."""
    return [sides.template_partners(each.partners) for each in laid]


def _no_guesses(sides: Sides) -> Guesses:
    return empty_guesses(_ROOM, -_FLOOR * _ROUGH * len(sides.drawn.places))


def _guess(
    guesses: Guesses,
    sides: Sides,
    most: int,
    fewest_pairs: int = _FEWEST_PAIRS,
    late: Late = never,
) -> Generator[int, None, None]:
    """Weigh the poses that follow from two pairings each, about so many at most.

    Where that is none, or it is late, those of the fewest pairs alone.
    """
    drawn, mapped = sides.drawn, sides.mapped
    rough = TOLERANCES._replace(omission=_ROUGH)
    grid = grid_of(mapped)
    pairs = _pairs(drawn, None if most else fewest_pairs)
    allowed = np.isfinite(sides.bonus).astype(np.float64)
    there_are = len(mapped.places)
    fewest = min(len(pairs), fewest_pairs) * there_are
    step = max(1, _STEP // len(drawn.places))
    while guesses.state[2] < len(pairs) * there_are:
        if guesses.state[2] >= fewest and (guesses.state[1] >= most or late()):
            break
        guess_poses(pairs, drawn, mapped, grid, allowed, rough, step, guesses)
        yield int(guesses.state[1])


def _refined(
    guesses: Guesses, sides: Sides, poses: int, late: Late = never
) -> Generator[int, None, list[Laid]]:
    """Return the different maps that the best guesses lead to."""
    found: dict[bytes, Laid] = {}
    count, weighed = int(guesses.state[0]), 0
    ranked = guesses.pairings[np.argsort(-guesses.scores[:count], kind="stable")[: 5 * poses]]
    step = min(_AT_ONCE, max(1, _PAIRINGS // sides.bonus.size))
    for low in range(0, len(ranked), step):
        for laid in _laid_by(ranked[low : low + step], sides):
            if len(found) < poses:
                _keep_better(found, laid)
        if len(found) >= poses or late():
            break
        weighed += step * sides.bonus.size
        if weighed + step * sides.bonus.size > _PAIRINGS:
            weighed = 0
            yield int(guesses.state[1])
    return sorted(found.values(), key=lambda laid: -laid.score)


def _laid_by(pairings: IntArray, sides: Sides) -> Iterator[Laid]:
    """Yield what the poses of pairings, shape (k, 4), lead to."""
    count = len(pairings)
    partners = np.empty((count, len(sides.drawn.places)), dtype=np.int64)
    poses, values = np.empty((count, 2), dtype=np.complex128), np.empty((count, 2))
    refine_guesses(
        pairings, sides.drawn, sides.mapped, sides.bonus, TOLERANCES, partners, poses, values
    )
    for each, (u, t), (growth, score) in zip(
        partners, poses.tolist(), values.tolist(), strict=True
    ):
        yield Laid(each, (u, t, growth), score)


def _filled(laid: Laid, sides: Sides) -> Laid:
    """Return a map under the same pose that gives each template object a partner."""
    partners = sides.drawn_partners(completed(laid, sides))
    worths = _worths(laid, sides)
    matched = np.flatnonzero(partners >= 0)
    score = float(worths[matched, partners[matched]].sum())
    return Laid(partners, laid.pose, score - TOLERANCES.omission * (len(partners) - len(matched)))


def _ranked(laid: Iterable[Laid]) -> list[Laid]:
    """Return the different maps, each under its best pose, what is worth most first."""
    found: dict[bytes, Laid] = {}
    for each in laid:
        _keep_better(found, each)
    return sorted(found.values(), key=lambda each: -each.score)


def _keep_better(found: dict[bytes, Laid], laid: Laid) -> None:
    """Keep a map by what it matches, under the better pose where it was met before."""
    key = laid.partners.tobytes()
    if key not in found or found[key].score < laid.score:
        found[key] = laid


def _varied(laid: list[Laid], sides: Sides, most: int) -> list[Laid]:
    """Return these maps and what single changes make of the best of them, the best so many."""
    if not laid:
        return []
    changed = np.empty((_CHANGES, len(sides.drawn.places)), dtype=np.int64)
    losses = np.empty(_CHANGES)
    maps = [np.stack([each.partners for each in laid])]
    scores = [np.array([each.score for each in laid])]
    of = [*range(len(laid))]
    for k, each in enumerate(laid[:_VARIED]):
        left = _LOSS - (laid[0].score - each.score)
        if left <= 0.0:
            break
        worths = _worths(each, sides)
        count = vary(worths, TOLERANCES.omission, each.partners, left, changed, losses)
        best = np.argsort(losses[:count], kind="stable")[:most]
        maps.append(changed[best])
        scores.append(each.score - losses[best])
        of += [k] * len(best)
    partners, worth = np.concatenate(maps), np.concatenate(scores)
    known: set[bytes] = set()
    chosen = []
    for k in np.argsort(-worth, kind="stable").tolist():
        key = partners[k].tobytes()
        if key not in known:
            known.add(key)
            chosen.append(k)
            if len(chosen) == most:
                break
    # A copy of these alone, so that the others are let go.
    return [
        Laid(each, laid[of[k]].pose, float(worth[k]))
        for each, k in zip(partners[chosen], chosen, strict=True)
    ]


def _pairs(drawn: Things, most: int | None = None) -> IntArray:
    """Return the sketched pairs to lay on others: far ones first, and each object soon."""
    n = len(drawn.places)
    return far_pairs(drawn.places, max(_PAIRS, 2 * n) if most is None else most)
