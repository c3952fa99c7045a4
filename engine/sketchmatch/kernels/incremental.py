"""ζ of object maps, brought up to date move by move.

A move gives a template object another partner; the object that has that partner, if any, takes
the old one in exchange. It changes at most 2N−3 of the Q entries of the induced FMAP. ζσ and ζR
follow from sums. ζL needs Σ|x − y| over all pairs of the Q dilations: with A the dilations that
leave, B those that come, and f(x) the sum of the distances from x to all Q before the move, it
changes by Σ_B f − Σ_A f − ∫(n_A − n_B)², where n(x) counts the dilations up to x. f follows from
prefix sums over the sorted dilations, the integral from A and B alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sketchmatch.kernels._jit import kernel
from sketchmatch.kernels.pairs import pair_index
from sketchmatch.kernels.sorting import sort_values
from sketchmatch.model.arrays import FloatArray, IntArray
from sketchmatch.model.maps import Weights
from sketchmatch.model.relations import DILATION_SCALE, RelationTable

__all__ = [
    "MapState",
    "confidence_after",
    "empty_map_state",
    "make_move",
    "map_confidence",
    "map_entry",
    "map_evidence",
    "place_map",
    "total_distance",
]

EVIDENCE, COSINE, SINE, DILATION, TURNED = range(5)


class MapState(NamedTuple):
    """An object map with all that its next move needs.

    Attributes
    ----------
    evidence
        Shape (Q, Q'/2) or (Q, Q'): of each entry, or for both an entry and its dual; read only.
    rotation, dilation
        Shape (Q, Q'/2): R and L of the relation table, read only.
    weights
        Shape (3 + Q,): of ζσ, ζR and ζL, whose sum is 1; then the rotation weights, what R of each
        template pair counts for. In an array of their own they would slow down every call.
    partners, holders
        int64, shapes (N,) and (N',): the partner of each template object, and the template object
        that has each argument object, or −1.
    entries
        Shape (N, N, 5): the evidence, cos R, sin R (both times the rotation weight) and L̂ of the
        entry of each template pair, and the evidence of its dual, in either order.
    sums
        Shape (4,): the sum of the evidence, Σ cos R, Σ sin R, and Σ|x − y| over all pairs of L̂.
    levels, prefix
        Shapes (Q,) and (Q+1,): all L̂ in order, and the sums of the first k of them.
    buckets
        int64, shape (Q+1,): how many L̂ lie below each of Q buckets of equal width.
    room
        Shape (2, 2N), for the L̂ that leave and come with a move.
    """

    evidence: FloatArray
    rotation: FloatArray
    dilation: FloatArray
    weights: FloatArray
    partners: IntArray
    holders: IntArray
    entries: FloatArray
    sums: FloatArray
    levels: FloatArray
    prefix: FloatArray
    buckets: IntArray
    room: FloatArray


def empty_map_state(table: RelationTable, weights: Weights) -> MapState:
    """Return room for an object map; :func:`place_map` fills it.

    Parameters
    ----------
    table
        Of N template and N' argument objects.
    weights
        Of ζσ, ζR and ζL, in any unit.

    Examples
    --------
    >>> table = RelationTable([[0.9]], [[0.0]], [[1.0]], 2, 2)
    >>> state = empty_map_state(table, (1.0, 2.0, 1.0))
    >>> state.holders.tolist(), state.weights.tolist()
    ([-1, -1], [0.25, 0.5, 0.25, 1.0])
    """
    objects, pairs = table.template_objects, table.template_pairs
    return MapState(
        evidence=table.entry_evidence,
        rotation=table.rotation,
        dilation=table.dilation,
        weights=np.concatenate([np.array(weights) / sum(weights), table.rotation_weights]),
        partners=np.zeros(objects, dtype=np.int64),
        holders=np.full(table.argument_objects, -1, dtype=np.int64),
        entries=np.zeros((objects, objects, 5)),
        sums=np.zeros(4),
        levels=np.zeros(pairs),
        prefix=np.zeros(pairs + 1),
        buckets=np.zeros(pairs + 1, dtype=np.int64),
        room=np.empty((2, 2 * objects)),
    )


@kernel
def place_map(state: MapState, partners: IntArray) -> float:
    """Make an injective object map the current one and return its ζ, in O(Q log Q).

    Parameters
    ----------
    state
        Room, whatever map is in it.
    partners
        int64, shape (N,), all different.

    Examples
    --------
    One pair on one: σ = 0.9, and the dual turns by 180° as a whole, which costs nothing.

    >>> table = RelationTable([[0.9]], [[0.0]], [[1.0]], 2, 2)
    >>> state = empty_map_state(table, (1.0, 0.0, 0.0))
    >>> float(place_map(state, np.array([1, 0])))
    0.9
    >>> state.entries[0, 1, [COSINE, DILATION]]
    array([-1.,  0.])
    """
    for c in range(state.holders.size):
        state.holders[c] = -1
    count = 0
    for a in range(partners.size):
        state.partners[a] = partners[a]
        state.holders[partners[a]] = a
        for b in range(a):
            _set_entry(state, a, b)
            state.levels[count] = state.entries[a, b, DILATION]
            count += 1
    sort_values(state.levels[:count])
    return _settle(state)


@kernel
def map_confidence(state: MapState) -> float:
    """Return ζ of the current map, in O(1).

    Examples
    --------
    >>> table = RelationTable([[0.7]], [[0.0]], [[1.0]], 2, 2)
    >>> state = empty_map_state(table, (1.0, 1.0, 1.0))
    >>> bool(place_map(state, np.array([0, 1])) == map_confidence(state))
    True
    >>> round(float(map_confidence(state)), 6)  # a single pair turns and grows as it does itself
    0.9
    """
    sums = state.sums
    return _confidence(
        state.weights,
        state.levels.size,
        sums[EVIDENCE],
        sums[COSINE],
        sums[SINE],
        sums[DILATION],
    )


@kernel
def confidence_after(state: MapState, a: int, c: int) -> float:
    """Return ζ of the map with partner c for object a, in O(N log N).

    Parameters
    ----------
    state
        The current map, which stays.
    a
        A template object.
    c
        An argument object other than a's partner. If another template object has it, that one
        takes a's partner.

    Returns
    -------
    float
        The same as :func:`make_move` would, but for rounding.

    Examples
    --------
    If 0 and 1 exchange their partners, pair (0, 1) is the dual of what it was, (0, 2) → (1, 2)
    and (1, 2) → (0, 2): (0.9 + 0.2 + 0.1) / 3.

    >>> similarity = np.array([[0.9, 0.2, 0.3], [0.1, 0.8, 0.2], [0.3, 0.1, 0.7]])
    >>> table = RelationTable(similarity, np.zeros((3, 3)), np.ones((3, 3)), 3, 3)
    >>> state = empty_map_state(table, (1.0, 0.0, 0.0))
    >>> round(float(place_map(state, np.array([0, 1, 2]))), 6)
    0.8
    >>> round(float(confidence_after(state, 0, 1)), 6)
    0.4
    >>> state.partners.tolist()
    [0, 1, 2]
    """
    entries, partners = state.entries, state.partners
    leaving, coming = state.room[0], state.room[1]
    b, old = state.holders[c], partners[a]
    similar, x, y, spread = state.sums
    count = 0
    for k in range(2 * partners.size):
        # First the entries of a, then those of b; theirs with each other turns round.
        first, partner = (a, c) if k < partners.size else (b, old)
        other = k % partners.size
        if first < 0 or other in (a, b):
            continue
        sigma, cosine, sine, level = map_entry(state, first, other, partner, partners[other])
        similar += sigma - entries[first, other, EVIDENCE]
        x += cosine - entries[first, other, COSINE]
        y += sine - entries[first, other, SINE]
        leaving[count], coming[count] = entries[first, other, DILATION], level
        spread += total_distance(state.levels, state.prefix, state.buckets, coming[count])
        spread -= total_distance(state.levels, state.prefix, state.buckets, leaving[count])
        count += 1
    if b >= 0:
        similar += entries[a, b, TURNED] - entries[a, b, EVIDENCE]
        x -= 2.0 * entries[a, b, COSINE]
        y -= 2.0 * entries[a, b, SINE]
    sort_values(leaving[:count])
    sort_values(coming[:count])
    spread -= _imbalance(leaving, coming, count)
    return _confidence(state.weights, state.levels.size, similar, x, y, spread)


@kernel
def make_move(state: MapState, a: int, c: int) -> float:
    """Give object a the partner c, as :func:`confidence_after` imagines it, and return ζ.

    All sums are taken anew, in O(Q), so that no rounding builds up over many moves.

    Parameters
    ----------
    state
        The current map, which changes.
    a
        A template object.
    c
        An argument object other than a's partner. If another template object has it, that one
        takes a's partner.

    Examples
    --------
    The first object takes what nobody had, and then what the second has:

    >>> table = RelationTable([[0.9, 0.4, 0.7]], np.zeros((1, 3)), np.ones((1, 3)), 2, 3)
    >>> state = empty_map_state(table, (1.0, 0.0, 0.0))
    >>> first = place_map(state, np.array([0, 1]))
    >>> float(make_move(state, 0, 2)), state.partners.tolist(), state.holders.tolist()
    (0.7, [2, 1], [-1, 1, 0])
    >>> float(make_move(state, 0, 1)), state.partners.tolist(), state.holders.tolist()
    (0.7, [1, 2], [-1, 0, 1])
    """
    partners, entries = state.partners, state.entries
    leaving, coming = state.room[0], state.room[1]
    b, old = state.holders[c], partners[a]
    partners[a] = c
    state.holders[old], state.holders[c] = b, a
    if b >= 0:
        partners[b] = old
    count = 0
    for k in range(2 * partners.size):
        first = a if k < partners.size else b
        other = k % partners.size
        if first < 0 or other in (first, a):
            continue
        leaving[count] = entries[first, other, DILATION]
        _set_entry(state, first, other)
        coming[count] = entries[first, other, DILATION]
        count += 1
    _replace(state.levels, leaving, coming, count)
    return _settle(state)


@kernel
def map_entry(state: MapState, a: int, b: int, c: int, d: int) -> tuple[float, float, float, float]:
    """Return evidence, cos R, sin R and L̂ of the entry (a, b) → (c, d), objects in any order.

    Cosine and sine are times the rotation weight of the pair.

    Parameters
    ----------
    state
        Any map; it counts for nothing.
    a, b
        Two template objects.
    c, d
        Two argument objects.

    Examples
    --------
    R is a quarter turn, and three quarters for the dual; L = 2 makes L̂ = 1.5.

    >>> table = RelationTable([[0.9]], [[np.pi / 2]], [[2.0]], 2, 2)
    >>> state = empty_map_state(table, (1.0, 1.0, 1.0))
    >>> np.round([map_entry(state, 0, 1, 0, 1), map_entry(state, 0, 1, 1, 0)], 6) + 0.0
    array([[ 0.9,  0. ,  1. ,  1.5],
           [ 0.9,  0. , -1. ,  1.5]])
    """
    i, j, sign = _place(state, a, b, c, d)
    rotation = state.rotation[i, j]
    turn = sign * state.weights[3 + i]
    level = DILATION_SCALE * np.log(state.dilation[i, j])
    return _evidence(state, i, j, sign), turn * np.cos(rotation), turn * np.sin(rotation), level


@kernel
def map_evidence(state: MapState, a: int, b: int, c: int, d: int) -> float:
    """Return the evidence of the entry (a, b) → (c, d) alone.

    Parameters
    ----------
    state, a, b, c, d
        As in :func:`map_entry`.

    Examples
    --------
    An entry and its dual may have evidence of their own:

    >>> table = RelationTable([[0.9]], [[0.0]], [[1.0]], 2, 2, evidence=[[0.8, 0.5]])
    >>> state = empty_map_state(table, (1.0, 1.0, 1.0))
    >>> [float(map_evidence(state, a, 1 - a, 0, 1)) for a in (0, 1)]
    [0.8, 0.5]
    """
    i, j, sign = _place(state, a, b, c, d)
    return _evidence(state, i, j, sign)


@kernel
def total_distance(
    levels: FloatArray, prefix: FloatArray, buckets: IntArray, value: float
) -> float:
    """Return f, the sum of the distances from a value to all levels of a state, in O(log Q).

    Parameters
    ----------
    levels, prefix, buckets
        Of a :class:`MapState`; shapes (Q,), (Q+1,) and (Q+1,).
    value
        Any number.

    Examples
    --------
    The L̂ of three pairs are 0, 1.5 and 3:

    >>> table = RelationTable(np.ones((3, 3)), np.zeros((3, 3)), [[1] * 3, [2] * 3, [4] * 3], 3, 3)
    >>> state = empty_map_state(table, (1.0, 1.0, 1.0))
    >>> zeta = place_map(state, np.array([0, 1, 2]))
    >>> [total_distance(state.levels, state.prefix, state.buckets, x) for x in (-1.0, 1.5, 2.0)]
    [7.5, 3.0, 3.5]
    """
    bucket = _bucket(levels, value)
    low, high = buckets[bucket], buckets[bucket + 1]
    while low < high:
        middle = (low + high) >> 1
        if levels[middle] <= value:
            low = middle + 1
        else:
            high = middle
    return float((2 * low - levels.size) * value + prefix[levels.size] - 2.0 * prefix[low])


@kernel
def _confidence(
    weights: FloatArray, pairs: int, similar: float, x: float, y: float, spread: float
) -> float:
    """Return ζ of four sums."""
    dilation = 1.0
    if pairs > 1:
        dilation = np.exp2(-2.0 * spread / (pairs * (pairs - 1.0)))
    rotation = np.sqrt(x * x + y * y) / pairs
    return float(weights[0] * similar / pairs + weights[1] * rotation + weights[2] * dilation)


@kernel
def _place(state: MapState, a: int, b: int, c: int, d: int) -> tuple[int, int, float]:
    """Return row and column of the entry (a, b) → (c, d), and −1.0 if it is a dual, else 1.0."""
    n, m = state.partners.size, state.holders.size
    sign = 1.0
    if a > b:
        a, b = b, a
        sign = -sign
    if c > d:
        c, d = d, c
        sign = -sign
    return pair_index(a, b, n), pair_index(c, d, m), sign


@kernel
def _evidence(state: MapState, i: int, j: int, sign: float) -> float:
    """Return the evidence of the entry in a place that :func:`_place` returned."""
    own = j if sign > 0.0 else j + state.evidence.shape[1] - state.rotation.shape[1]
    return float(state.evidence[i, own])


@kernel
def _set_entry(state: MapState, a: int, b: int) -> None:
    """Look up the entry of a template pair under the current partners."""
    c, d = state.partners[a], state.partners[b]
    values = map_entry(state, a, b, c, d)
    for part in range(4):
        state.entries[a, b, part] = values[part]
        state.entries[b, a, part] = values[part]
    state.entries[a, b, TURNED] = state.entries[b, a, TURNED] = map_evidence(state, a, b, d, c)


@kernel
def _bucket(levels: FloatArray, value: float) -> int:
    """Return the bucket of a level; the first and the last hold all that lies beyond."""
    last = levels.size - 1
    low, high = levels[0], levels[last]
    if value <= low or high <= low:
        return 0
    # As a float: far beyond nearly equal levels it is larger than any integer.
    return int(min(float(last), (value - low) / (high - low) * levels.size))


@kernel
def _imbalance(leaving: FloatArray, coming: FloatArray, count: int) -> float:
    """Return ∫(n_A − n_B)² for the first ``count`` values of two sorted arrays."""
    total = last = 0.0
    i = j = 0
    while i < count or j < count:
        excess = i - j
        if j == count or (i < count and leaving[i] <= coming[j]):
            value = leaving[i]
            i += 1
        else:
            value = coming[j]
            j += 1
        total += excess * excess * (value - last)
        last = value
    return total


@kernel
def _replace(levels: FloatArray, leaving: FloatArray, coming: FloatArray, count: int) -> None:
    """Take ``count`` leaving values out of the sorted levels and put the coming ones in."""
    sort_values(leaving[:count])
    sort_values(coming[:count])
    gone = 0
    for k in range(levels.size):
        if gone < count and leaving[gone] == levels[k]:
            gone += 1
        else:
            levels[k - gone] = levels[k]
    left = levels.size - count
    place = levels.size
    while count > 0:
        place -= 1
        if left == 0 or coming[count - 1] > levels[left - 1]:
            count -= 1
            levels[place] = coming[count]
        else:
            left -= 1
            levels[place] = levels[left]


@kernel
def _settle(state: MapState) -> float:
    """Take all sums from the entries and the levels, and return ζ."""
    sums, values, buckets, entries = state.sums, state.levels, state.buckets, state.entries
    similar = x = y = spread = total = 0.0
    for a in range(state.partners.size):
        for b in range(a):
            similar += entries[a, b, EVIDENCE]
            x += entries[a, b, COSINE]
            y += entries[a, b, SINE]
    for k in range(values.size + 1):
        buckets[k] = 0
    for k in range(values.size):
        total += values[k]
        spread += (2 * k - values.size + 1) * values[k]
        state.prefix[k + 1] = total
        buckets[_bucket(values, values[k]) + 1] += 1
    for k in range(values.size):
        buckets[k + 1] += buckets[k]
    sums[EVIDENCE], sums[COSINE], sums[SINE], sums[DILATION] = similar, x, y, spread
    return map_confidence(state)
