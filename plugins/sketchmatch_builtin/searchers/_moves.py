"""Local search over object maps that weighs every move of a map in constant time.

A move gives a template object a another partner c; the object b that has c, if any, takes a's in
exchange. For each a and c the sums of σ, cos R and sin R over the entries that a would have with
c are kept, and brought up to date in O(N N') when a move is made; four of them tell what a move
does to ζσ and ζR (the idea: Taillard 1991). For ζL, f, the distance of a dilation to all others,
is summed in the same way. f itself changes with the map, so these sums grow stale: they propose
moves, exact evaluation decides. Before a map counts as a local optimum they are taken anew, and
an upper bound of ζ after each move excludes nearly all moves; the rest is evaluated.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sketchmatch.api.kernels import (
    MapState,
    confidence_after,
    kernel,
    make_move,
    map_confidence,
    map_entry,
    map_evidence,
    pair_index,
    total_distance,
)
from sketchmatch.model import FloatArray, IntArray, pair_count

__all__ = [
    "GAIN",
    "Moves",
    "add_turned_values",
    "add_values",
    "climb",
    "empty_moves",
    "read_relations",
    "renew_moves",
    "weigh_moves",
]

GAIN = 1e-12
"""Less is rounding."""

_MARGIN = 1e-6
"""Above what float32 may do to an estimate of ζ, for L̂ up to 1."""

_S, _X, _Y, _L, _TURNED = range(5)
_BEGIN, _GUESS, _CHECK, _END = range(4)


class Moves(NamedTuple):
    """What is known about the moves of the current map; every field is changed in place.

    Attributes
    ----------
    directed
        Whether a dual has evidence of its own, which need not be that of its column.
    relations
        float32, shape (Q, N', N', 4): evidence, cos R, sin R and L̂ of the entries (a, b) → (c, d),
        a < b, by d and then c. This lies as it is read. Its precision is enough to propose moves
        and, with a margin, to exclude them; that c and d come in both orders makes up for its size.
    sums
        Shape (N, N', 4): sums of σ, cos R, sin R and of a bound of f over the entries that each
        template object would have with each partner, without the entry with its holder.
    slack
        Shape (N, N'): how much more Σ|x − y| over dilations may fall than f says.
    distances
        Shape (N,): the sum of f over each template object's entries.
    lines
        Shape (Q + 1, 2): slope and intercept of a line below f, for Q intervals of equal width;
        and in the end where these begin, and how many there are to a unit.
    values
        Shape (N',): ζ after the moves of one object.
    status
        int64, shape (3,): the phase, the object whose moves are checked next, and the moves made
        since all was taken anew.
    evaluations
        int64, shape (1,): maps evaluated so far.
    """

    directed: bool
    relations: NDArray[np.float32]
    sums: FloatArray
    slack: FloatArray
    distances: FloatArray
    lines: FloatArray
    values: FloatArray
    status: IntArray
    evaluations: IntArray


def empty_moves(template_objects: int, argument_objects: int, directed: bool = False) -> Moves:
    """Return room for the moves of a map."""
    pairs = pair_count(template_objects)
    return Moves(
        directed=directed,
        relations=np.empty((pairs, argument_objects, argument_objects, 4), dtype=np.float32),
        sums=np.zeros((template_objects, argument_objects, 4)),
        slack=np.zeros((template_objects, argument_objects)),
        distances=np.zeros(template_objects),
        lines=np.zeros((pairs + 1, 2)),
        values=np.zeros(argument_objects),
        status=np.zeros(3, dtype=np.int64),
        evaluations=np.zeros(1, dtype=np.int64),
    )


@kernel
def read_relations(
    state: MapState,
    moves: Moves,
    pairs: IntArray,
    others: IntArray,
    first: int,
    last: int,
    leanings: FloatArray,
) -> None:
    """Read a part of the relation table, into the moves and into the leanings.

    Parameters
    ----------
    pairs, others
        Shapes (Q, 2) and (Q'/2, 2), the template pairs and the argument pairs.
    first, last
        Which values, counted row by row from 0 to Q·Q'/2.
    leanings
        Shape (N, N', 3), added to: Σe, Σ cos R and Σ sin R over the entries that a template
        object would have with a partner and any partners of the other objects.
    """
    relations = moves.relations
    for index in range(first, last):
        i, j = index // others.shape[0], index % others.shape[0]
        a, b, c, d = pairs[i, 0], pairs[i, 1], others[j, 0], others[j, 1]
        values = map_entry(state, a, b, c, d)
        for part in range(4):
            # The dual (a, b) → (d, c) has the same L̂ and the opposite direction.
            value = values[part]
            dual = -value if part in (_X, _Y) else value
            if part == _S and moves.directed:
                dual = map_evidence(state, a, b, d, c)
            relations[i, d, c, part] = value
            relations[i, c, d, part] = dual
            if part != _L:
                leanings[a, c, part] += value
                leanings[b, d, part] += value
                leanings[a, d, part] += dual
                leanings[b, c, part] += dual


@kernel
def climb(state: MapState, moves: Moves, floor: float, allowance: int) -> bool:
    """Make moves that raise ζ until no move does.

    Parameters
    ----------
    state
        The map.
    moves
        Its moves; a status of zeros says that the map is new.
    floor
        A map that does not promise to exceed this is left before it is certain that no move helps.
    allowance
        The work to do in this call, about in entries of the relation table that are read.

    Returns
    -------
    bool
        Whether it is done.
    """
    objects, others = moves.slack.shape
    status = moves.status
    here = map_confidence(state)
    while allowance > 0 and status[0] != _END:
        if status[0] == _BEGIN:
            renew_moves(state, moves)
            status[0] = _GUESS
            allowance -= objects * objects * others
        if status[0] == _GUESS:
            a, c = _most_promising(state, moves)
            allowance -= 5 * objects * others
        else:
            a = status[1]
            allowance -= others + 20 * objects * weigh_moves(state, moves, a, here + GAIN)
            c = _best(moves.values)
        if c >= 0 and confidence_after(state, a, c) > here + GAIN:
            _update_sums(state, moves, a, c)
            here = make_move(state, a, c)
            status[0] = _GUESS
            status[2] += 1
        else:
            _turn_to_next(status, objects, here <= floor)
        moves.evaluations[0] += 1
    return bool(status[0] == _END)


@kernel
def weigh_moves(state: MapState, moves: Moves, a: int, threshold: float) -> int:
    """Find ζ after those moves of object a that may lead above a threshold.

    Exchanges with objects before a are left out, as theirs. No move may have been made since the
    sums were taken anew.

    Parameters
    ----------
    moves
        ``values`` are written: ζ, or −1 where it is not above the threshold.
    a
        A template object.
    threshold
        A ζ.

    Returns
    -------
    int
        How many moves were evaluated.
    """
    sums, slack, distances, pairs = moves.sums, moves.slack, moves.distances, state.levels.size
    total, entries = state.sums, state.entries
    scale = 2.0 / max(1.0, pairs * (pairs - 1.0))
    w_s, w_r = state.weights[0] / pairs, state.weights[1] / pairs
    w_l = state.weights[2]
    margin = _MARGIN * (1.0 + max(abs(state.levels[0]), abs(state.levels[pairs - 1])))
    old, evaluated = state.partners[a], 0
    for c in range(moves.values.size):
        moves.values[c] = -1.0
        b = state.holders[c]
        if b >= 0 and b <= a:
            continue
        similar, x, y, _ = _estimate(total, entries, sums, moves.lines, a, old, b, c)
        spread = total[_L] + sums[a, c, _L] - distances[a] - slack[a, c]
        if b >= 0:
            spread += sums[b, old, _L] - distances[b] - slack[b, old]
            spread += 2.0 * _line(moves.lines, entries[a, b, _L])
        bound = w_s * similar + w_r * np.sqrt(x * x + y * y)
        bound += w_l * np.exp2(-scale * max(0.0, spread))
        if bound + margin > threshold:
            evaluated += 1
            value = confidence_after(state, a, c)
            if value > threshold:
                moves.values[c] = value
    moves.evaluations[0] += evaluated
    return evaluated


@kernel
def renew_moves(state: MapState, moves: Moves) -> None:
    """Take all sums anew."""
    _renew_lines(state, moves.lines)
    objects, others = moves.slack.shape
    for a in range(objects):
        moves.distances[a] = 0.0
        for c in range(others):
            moves.slack[a, c] = 0.0
            for part in range(4):
                moves.sums[a, c, part] = 0.0
    # The number of entries that a move changes, |A|, bounds |n_A − n_B|.
    most = float(max(objects - 1, 2 * objects - 4))
    for a in range(objects):
        for k in range(objects):
            if k != a:
                _add_entries(state, moves, a, k, state.partners[k], 1.0, most)
                if moves.directed and a > k:
                    _add_turned(moves, a, k, state.partners[k], 1.0)
                moves.distances[a] += total_distance(
                    state.levels, state.prefix, state.buckets, state.entries[a, k, _L]
                )
    moves.status[2] = 0


@kernel
def add_values(
    moves: Moves,
    a: int,
    k: int,
    partner: int,
    similar: float,
    x: float,
    y: float,
    steep: float,
    level: float,
    values: FloatArray,
) -> None:
    """Add e, cos R and sin R of the entries (a, k) → (c, partner), each times a factor, for all c.

    ``steep`` times the distance of L̂ from a level is taken off. ``values`` has shape (N',).
    Where moves are directed and a > k, :func:`add_turned_values` has to follow.
    """
    objects = moves.slack.shape[0]
    low, high = min(a, k), max(a, k)
    relations = moves.relations[pair_index(low, high, objects), partner]
    sign = 1.0 if a < k else -1.0
    for c in range(values.size):
        if c != partner:
            values[c] += similar * relations[c, _S]
            values[c] += sign * (x * relations[c, _X] + y * relations[c, _Y])
            values[c] -= steep * abs(relations[c, _L] - level)


@kernel
def add_turned_values(
    moves: Moves, a: int, k: int, partner: int, similar: float, values: FloatArray
) -> None:
    """Correct values by the evidence of the entries (k, a) → (partner, c), for a > k and all c.

    :func:`add_values` has added that of (k, a) → (c, partner), which lies together; within its
    loop a choice between the two would cost half as much again.
    """
    objects = moves.slack.shape[0]
    row = moves.relations[pair_index(k, a, objects)]
    for c in range(values.size):
        if c != partner:
            values[c] += similar * (row[c, partner, _S] - row[partner, c, _S])


@kernel
def _turn_to_next(status: IntArray, objects: int, hopeless: bool) -> None:
    """Turn to the next phase, or object, after one in which no move helped."""
    if status[0] == _CHECK:
        status[1] += 1
        if status[1] == objects:
            status[0] = _END
    elif status[2] == 0:
        status[0], status[1] = _CHECK, 0
    else:
        status[0] = _END if hopeless else _BEGIN


@kernel
def _most_promising(state: MapState, moves: Moves) -> tuple[int, int]:
    """Return the move with the highest estimate of ζ above that of the map, or −1, −1."""
    objects, others = moves.slack.shape
    pairs = state.levels.size
    scale = 2.0 / max(1.0, pairs * (pairs - 1.0))
    w_s, w_r = state.weights[0] / pairs, state.weights[1] / pairs
    level = state.weights[2] * np.exp2(-scale * state.sums[_L])
    total, entries, sums, lines = state.sums, state.entries, moves.sums, moves.lines
    # The tangent of exp2.
    slope = np.log(2.0) * scale * level
    best, best_a, best_c = map_confidence(state) + _MARGIN, -1, -1
    for a in range(objects):
        old = state.partners[a]
        for c in range(others):
            b = state.holders[c]
            if b < 0 or b > a:
                similar, x, y, spread = _estimate(total, entries, sums, lines, a, old, b, c)
                value = w_s * similar + w_r * np.sqrt(x * x + y * y) + level - slope * spread
                if value > best:
                    best, best_a, best_c = value, a, c
    return best_a, best_c


@kernel
def _estimate(
    total: FloatArray,
    entries: FloatArray,
    sums: FloatArray,
    lines: FloatArray,
    a: int,
    old: int,
    b: int,
    c: int,
) -> tuple[float, float, float, float]:
    """Return Σe, Σ cos R and Σ sin R after a move, and about how Σ|x − y| changes."""
    similar = total[_S] + sums[a, c, _S] - sums[a, old, _S]
    x = total[_X] + sums[a, c, _X] - sums[a, old, _X]
    y = total[_Y] + sums[a, c, _Y] - sums[a, old, _Y]
    spread = sums[a, c, _L] - sums[a, old, _L]
    if b >= 0:
        # The entry (a, b) is in both sums that go, in neither that comes, and turns round.
        similar += sums[b, old, _S] - sums[b, c, _S] + (entries[a, b, _S] + entries[a, b, _TURNED])
        x += sums[b, old, _X] - sums[b, c, _X]
        y += sums[b, old, _Y] - sums[b, c, _Y]
        spread += sums[b, old, _L] - sums[b, c, _L] + 2.0 * _line(lines, entries[a, b, _L])
    return similar, x, y, spread


@kernel
def _best(values: FloatArray) -> int:
    """Return the place of the highest value, or −1 if none is above 0."""
    best = -1
    for c in range(values.size):
        if values[c] > (values[best] if best >= 0 else 0.0):
            best = c
    return best


@kernel
def _update_sums(state: MapState, moves: Moves, a: int, c: int) -> None:
    """Bring all sums up to date with a move that is about to be made."""
    b, old = state.holders[c], state.partners[a]
    for k in range(moves.distances.size):
        for other, before, after in ((a, old, c), (b, c, old)):
            if other >= 0 and k != other:
                _add_entries(state, moves, k, other, before, -1.0, 0.0)
                _add_entries(state, moves, k, other, after, 1.0, 0.0)
                if moves.directed and k > other:
                    _add_turned(moves, k, other, before, -1.0)
                    _add_turned(moves, k, other, after, 1.0)


@kernel
def _add_entries(
    state: MapState, moves: Moves, a: int, k: int, partner: int, factor: float, most: float
) -> None:
    """Add the entries (a, k) → (c, partner), for all c, to the sums and the slack of a."""
    sums, lines, slack = moves.sums, moves.lines, moves.slack
    objects, others = slack.shape
    low, high = min(a, k), max(a, k)
    relations = moves.relations[pair_index(low, high, objects), partner]
    now = state.entries[a, k, _L]
    sign = factor if a < k else -factor
    for c in range(others):
        if c != partner:
            level = np.float64(relations[c, _L])
            sums[a, c, _S] += factor * relations[c, _S]
            sums[a, c, _X] += sign * relations[c, _X]
            sums[a, c, _Y] += sign * relations[c, _Y]
            sums[a, c, _L] += factor * _line(lines, level)
            slack[a, c] += most * abs(level - now)


@kernel
def _add_turned(moves: Moves, a: int, k: int, partner: int, factor: float) -> None:
    """Correct the sums of a after :func:`_add_entries`, as :func:`add_turned_values` does."""
    add_turned_values(moves, a, k, partner, factor, moves.sums[a, :, _S])


@kernel
def _line(lines: FloatArray, value: float) -> float:
    """Return a bound of f that is close to it, as f was when all was taken anew."""
    last = lines.shape[0] - 1
    place = (value - lines[last, 0]) * lines[last, 1]
    k = int(min(max(place, 0.0), last - 1.0))
    return float(lines[k, 0] * value + lines[k, 1])


@kernel
def _renew_lines(state: MapState, lines: FloatArray) -> None:
    """Put one line below f for each bucket: with any rank k, f(x) ≥ (2k − Q)x + Σ − 2Σ_k."""
    prefix, count = state.prefix, state.levels.size
    low, high = state.levels[0], state.levels[count - 1]
    for k in range(count):
        rank = (state.buckets[k] + state.buckets[k + 1]) // 2
        lines[k, 0] = 2 * rank - count
        lines[k, 1] = prefix[count] - 2.0 * prefix[rank]
    lines[count, 0] = low
    lines[count, 1] = count / (high - low) if high > low else 0.0
