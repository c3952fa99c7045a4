"""Compiled steps of an evolution of object maps that climb before they compete."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sketchmatch.api.kernels import MapState, kernel, map_confidence, map_entry, place_map
from sketchmatch.model import DILATION_SCALE, FloatArray, IntArray
from sketchmatch_builtin.searchers._moves import GAIN, Moves, add_turned_values, add_values
from sketchmatch_builtin.searchers._ranking import Ranking, insert

__all__ = ["Plan", "admit", "breed", "offer"]

_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)

_STEEP = 1.0
"""What an entry's distance of 1 from the level of a new map costs it, as a part of ζL."""


class Plan(NamedTuple):
    """How to breed; :class:`~sketchmatch_builtin.searchers.direct.Direct` describes the fields."""

    tournament: int
    renewal_rate: float
    exchange_rate: float
    variety: float


@kernel
def breed(
    state: MapState,
    moves: Moves,
    members: Ranking,
    leanings: FloatArray,
    born: int,
    plan: Plan,
    rng: np.random.Generator,
) -> None:
    """Make the next child the current map: a new map at first, a cross later.

    ``born`` is how many were before.
    """
    objects, others = leanings.shape[0], leanings.shape[1]
    child, mate = np.empty(objects, dtype=np.int64), np.empty(objects, dtype=np.int64)
    count = 0
    while count < members.values.size and members.values[count] >= 0.0:
        count += 1
    crossing = born >= members.values.size
    renewing = not crossing or count == 1 or rng.random() < plan.renewal_rate
    first = _select(count, plan.tournament, rng) if crossing else 0
    if renewing:
        rotation, level = 2.0 * np.pi * _GOLDEN * born, _any_level(state, rng)
        if crossing:
            rotation, level = _rotation_and_level(state, members.maps[first])
        _found(state, moves, leanings, rotation, level, plan.variety, mate, rng)
    else:
        second = _select(count - 1, plan.tournament, rng)
        if second >= first:
            second += 1
        mate = members.maps[second]
    if crossing:
        _cross(members.maps[first], mate, plan.exchange_rate, child, others, rng)
        mate = child
    place_map(state, mate)


@kernel
def admit(state: MapState, members: Ranking, kept: Ranking) -> bool:
    """Let the current map compete; return whether it is the best so far."""
    value = map_confidence(state)
    better = bool(value > kept.values[0] + GAIN)
    insert(members, state.partners, value)
    insert(kept, state.partners, value)
    return better


@kernel
def offer(state: MapState, moves: Moves, a: int, kept: Ranking) -> None:
    """Offer what the moves of object a lead to, once they are weighed."""
    child = np.empty(state.partners.size, dtype=np.int64)
    for c in range(moves.values.size):
        if moves.values[c] >= 0.0:
            for k in range(child.size):
                child[k] = state.partners[k]
            if state.holders[c] >= 0:
                child[state.holders[c]] = child[a]
            child[a] = c
            insert(kept, child, moves.values[c])


@kernel
def _select(count: int, tournament: int, rng: np.random.Generator) -> int:
    """Return the best of some random members."""
    best = count
    for _ in range(tournament):
        best = min(best, int(rng.random() * count))
    return best


@kernel
def _found(
    state: MapState,
    moves: Moves,
    leanings: FloatArray,
    rotation: float,
    level: float,
    variety: float,
    child: IntArray,
    rng: np.random.Generator,
) -> None:
    """Make a map for a global rotation and dilation: each object takes the partner that suits.

    What suits is the expected part of an object's entries in ζσ and, for this rotation, ζR: known
    where the other object has its partner, on average over all partners where not. Known entries
    also lose by the distance of their L̂ from the level.
    """
    objects, others = leanings.shape[0], leanings.shape[1]
    weights = state.weights
    similar = weights[0] / (objects - 1)
    x = weights[1] * np.cos(rotation) / (objects - 1)
    y = weights[1] * np.sin(rotation) / (objects - 1)
    steep = _STEEP * weights[2] / (objects - 1)
    free = np.ones(others, dtype=np.bool_)
    order = _shuffled(objects, rng)
    values = np.empty(others)
    for place in range(objects):
        a = order[place]
        share = (objects - 1.0 - place) / ((objects - 1.0) * (others - 1.0))
        for c in range(others):
            lean = similar * leanings[a, c, 0] + x * leanings[a, c, 1] + y * leanings[a, c, 2]
            values[c] = share * lean + variety * rng.random()
        for before in range(place):
            k = order[before]
            add_values(moves, a, k, child[k], similar, x, y, steep, level, values)
            if moves.directed and a > k:
                add_turned_values(moves, a, k, child[k], similar, values)
        best = -1
        for c in range(others):
            if free[c] and (best < 0 or values[c] > values[best]):
                best = c
        child[a] = best
        free[best] = False


@kernel
def _cross(
    parent: IntArray,
    mate: IntArray,
    exchange_rate: float,
    child: IntArray,
    others: int,
    rng: np.random.Generator,
) -> None:
    """Give each object its partner in the parent or the mate, or a random one if both are taken."""
    free = np.ones(others, dtype=np.bool_)
    order = _shuffled(child.size, rng)
    for a in order:
        first, second = parent[a], mate[a]
        if rng.random() < exchange_rate:
            first, second = second, first
        child[a] = first if free[first] else second
        if free[child[a]]:
            free[child[a]] = False
        else:
            child[a] = -1
    left = _shuffled(others, rng)
    place = 0
    for a in range(child.size):
        if child[a] < 0:
            while not free[left[place]]:
                place += 1
            child[a] = left[place]
            place += 1


@kernel
def _shuffled(count: int, rng: np.random.Generator) -> IntArray:
    """Return 0 … count − 1 in random order."""
    order = np.arange(count)
    for k in range(count - 1):
        other = k + int(rng.random() * (count - k))
        order[k], order[other] = order[other], order[k]
    return order


@kernel
def _any_level(state: MapState, rng: np.random.Generator) -> float:
    """Return L̂ of a random entry."""
    i = int(rng.random() * state.dilation.shape[0])
    j = int(rng.random() * state.dilation.shape[1])
    return float(DILATION_SCALE * np.log(state.dilation[i, j]))


@kernel
def _rotation_and_level(state: MapState, partners: IntArray) -> tuple[float, float]:
    """Return the global rotation arg Σ e^{iR} of a map, and the mean of its L̂."""
    x = y = total = 0.0
    for a in range(partners.size):
        for b in range(a):
            _, cosine, sine, level = map_entry(state, a, b, partners[a], partners[b])
            x += cosine
            y += sine
            total += level
    return float(np.arctan2(y, x)), total / state.levels.size
