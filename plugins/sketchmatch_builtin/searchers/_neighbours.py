"""Compiled steps that grow FMAPs in the space of (σ̂, R̂, L̂), in slices.

A vector stands for a histogram correspondence i → j'. It is numbered i·Q'/2 + c with its column
c = j' mod Q'/2 and told from its dual by a sign: the dual has the same σ̂ and L̂. Its R̂ is 1 − R̂
where half turns are folded onto each other, and R̂ + 1 where R̂ is circular, of period 2.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sketchmatch.api.kernels import fmap_confidence, kernel
from sketchmatch.model import DILATION_SCALE, FloatArray, IntArray

__all__ = [
    "ClosenessStore",
    "Features",
    "FuzzyGrowth",
    "Membership",
    "NearestGrowth",
    "distance_sums",
    "entries_confidence",
    "grow_closest",
    "grow_nearest",
    "nearest_vector",
    "sampled_distance_sums",
]

BoolArray = NDArray[np.bool_]

_LARGEST_EXPONENT = 700.0


class Features(NamedTuple):
    """The vectors.

    Attributes
    ----------
    similarity, rotation, level
        Shape (Q, Q'/2): σ̂, R in radians within [0, 2π), and L̂ less its mean over the table.
    folded
        Whether R̂ is R/180° up to 180° and falls back to 0 beyond (thesis 3.3), so that a vector
        and its dual are one point at R = ±90°. Otherwise R̂ is R/180°, and differences are
        taken modulo 2.
    """

    similarity: FloatArray
    rotation: FloatArray
    level: FloatArray
    folded: bool


class Membership(NamedTuple):
    """μ_close(d) = 1 / (1 + e^(steepness·(d − centre))), thesis 3.6.1."""

    steepness: float
    centre: float


class NearestGrowth(NamedTuple):
    """An FMAP that grows by distance.

    Attributes
    ----------
    entries
        Shape (Q,), −1 where empty.
    taken
        Shape (Q'/2,): whether a column or its dual is in the FMAP.
    bounds, candidates
        Shape (Q,): the squared distance of the nearest vector of each row, and its entry. It may
        have been taken since; then the squared distance is a lower bound.
    state
        Rows scanned and entries placed.
    """

    entries: IntArray
    taken: BoolArray
    bounds: FloatArray
    candidates: IntArray
    state: IntArray


class FuzzyGrowth(NamedTuple):
    """An FMAP that grows by aggregate confidence.

    Attributes
    ----------
    entries
        Shape (Q,), −1 where empty.
    columns
        Shape (Q'/2,): the free ones first, in order.
    close, apart
        Shape (Q, 2, Q'/2): A·CA = ΣC(a)·μ and ΣC(a)·(1 − μ) of each vector and, in the second
        plane, of its dual; only those of empty rows and free columns are kept up to date.
    state
        Entries placed, next row of the step, row placed last, best row and best entry so far.
    strength
        Confidence C of the vector placed last, and the two sums of the best vector so far.
    """

    entries: IntArray
    columns: IntArray
    close: FloatArray
    apart: FloatArray
    state: IntArray
    strength: FloatArray


class ClosenessStore(NamedTuple):
    """Closeness between vectors, kept when first needed.

    Attributes
    ----------
    values
        Shape (capacity, 2, H), H = Q·Q'/2: 1/μ − 1 of the closeness μ of one vector to each and,
        in the second plane, to its dual.
    places
        Shape (H,): where in ``values`` each vector is, −1 where it is not. Empty if they are.
    used
        Shape (1,): how many there are.
    """

    values: FloatArray
    places: IntArray
    used: IntArray


@kernel
def entries_confidence(
    entries: IntArray,
    similarity: FloatArray,
    rotation: FloatArray,
    dilation: FloatArray,
    rotation_weights: FloatArray,
    weights: FloatArray,
) -> float:
    """Return ζ of an FMAP, reading only its own entries of the relation table."""
    count, pairs = similarity.shape
    own = np.empty((4, count, 1))
    signs = np.empty(count, dtype=np.int64)
    for i in range(count):
        c = entries[i] % pairs
        signs[i] = entries[i] // pairs
        own[0, i, 0] = similarity[i, c]
        own[1, i, 0] = rotation_weights[i] * np.cos(rotation[i, c])
        own[2, i, 0] = rotation_weights[i] * np.sin(rotation[i, c])
        own[3, i, 0] = DILATION_SCALE * np.log(dilation[i, c])
    return fmap_confidence(signs, np.empty(count), own[0], own[1], own[2], own[3], weights)[0]


@kernel
def grow_nearest(growth: NearestGrowth, seed: FloatArray, features: Features, budget: int) -> bool:
    """Grow an FMAP by distance to ``seed`` (thesis 3.5) and return whether it is full.

    Call it again until it is; each call measures about ``budget`` distances. Instead of sorting
    all distances, it keeps the nearest of each row and looks again when that has been taken.
    """
    entries, taken, bounds, candidates, state = growth
    rows, pairs = entries.size, taken.size
    while state[0] < rows:
        if budget <= 0:
            return False
        i = state[0]
        bounds[i], candidates[i] = _nearest_in_row(i, seed, features, taken)
        state[0] += 1
        budget -= 2 * pairs
    while state[1] < rows:
        if budget <= 0:
            return False
        i = int(np.argmin(bounds))
        budget -= rows
        if taken[candidates[i] % pairs]:
            bounds[i], candidates[i] = _nearest_in_row(i, seed, features, taken)
            budget -= 2 * pairs
        else:
            entries[i] = candidates[i]
            taken[candidates[i] % pairs] = True
            bounds[i] = np.inf
            state[1] += 1
    return True


@kernel
def nearest_vector(
    seed: FloatArray, features: Features, taken: BoolArray, first: int, last: int
) -> tuple[float, int, int]:
    """Return squared distance, row and entry of the vector of some rows that is nearest to seed."""
    bound, row, entry = np.inf, -1, -1
    for i in range(first, last):
        distance, candidate = _nearest_in_row(i, seed, features, taken)
        if distance < bound:
            bound, row, entry = distance, i, candidate
    return bound, row, entry


@kernel
def grow_closest(
    growth: FuzzyGrowth,
    features: Features,
    membership: Membership,
    store: ClosenessStore,
    budget: int,
) -> bool:
    """Grow an FMAP by aggregate confidence (thesis 3.6) and return whether it is full.

    Call it again until it is; each call takes about ``budget`` degrees of closeness. The first
    vector must be the best row and entry of the state. The closeness to it enters as 1: its own
    confidence C(0) is a factor of all that follow and so changes no choice.

    In the middle of a cluster every μ is 1 to the last digit. The sums of μ and of 1 − μ add up to
    the same for all vectors, so whichever is the smaller tells which vector is better.
    """
    entries, columns, state = growth.entries, growth.columns, growth.state
    rows, pairs = entries.size, columns.size
    while True:
        if state[1] == rows or state[0] == 0:
            _place_best(growth)
        if state[0] == rows:
            return True
        last = state[2]
        number = last * pairs + entries[last] % pairs
        if store.used[0] < len(store.values) and store.places[number] < 0:
            _fill(number, features, membership, store)
            budget -= 2 * rows * pairs
        while state[1] < rows:
            if budget <= 0:
                return False
            i = state[1]
            if entries[i] < 0:
                _add_closeness(i, growth, features, membership, store)
                budget -= 2 * (pairs - state[0])
            state[1] += 1


@kernel
def distance_sums(
    features: Features, first: int, last: int, origin: float
) -> tuple[int, float, float]:
    """Return number, Σ(d − origin) and Σ(d − origin)² of distances between compatible vectors.

    Each unordered pair counts once that has its lower row in a vector numbered first … last − 1,
    and once more with one of the two replaced by its dual. (All other pairs mirror these.)
    """
    rows, pairs = features.similarity.shape
    count, total, square = 0, 0.0, 0.0
    for number in range(first, last):
        row, column = number // pairs, number % pairs
        own_total = own_square = 0.0
        for i in range(row + 1, rows):
            for c in range(pairs):
                if c != column:
                    direct, crossed = _distances(features, row, column, i, c)
                    own_total += (direct - origin) + (crossed - origin)
                    own_square += (direct - origin) ** 2 + (crossed - origin) ** 2
        count += 2 * (rows - 1 - row) * (pairs - 1)
        total += own_total
        square += own_square
    return count, total, square


@kernel
def sampled_distance_sums(
    features: Features, draws: int, origin: float, rng: np.random.Generator
) -> tuple[int, float, float]:
    """Return what :func:`distance_sums` does, of compatible vectors drawn at random."""
    rows, pairs = features.similarity.shape
    total = square = 0.0
    for _ in range(draws):
        row, column = int(rng.random() * rows), int(rng.random() * pairs)
        i, c = int(rng.random() * (rows - 1)), int(rng.random() * (pairs - 1))
        direct, crossed = _distances(features, row, column, i + (i >= row), c + (c >= column))
        total += (direct - origin) + (crossed - origin)
        square += (direct - origin) ** 2 + (crossed - origin) ** 2
    return 2 * draws, total, square


@kernel
def _nearest_in_row(
    i: int, seed: FloatArray, features: Features, taken: BoolArray
) -> tuple[float, int]:
    """Return squared distance and entry of the free vector of row i that is nearest to seed."""
    pairs = taken.size
    nearest, nearest_dual = np.inf, np.inf
    entry, dual = -1, -1
    for c in range(pairs):
        if not taken[c]:
            rest = (features.similarity[i, c] - seed[0]) ** 2
            rest += (features.level[i, c] - seed[2]) ** 2
            if features.folded:
                turn = _folded(features.rotation[i, c])
                direct, crossed = turn - seed[1], 1.0 - turn - seed[1]
            else:
                direct, crossed = _around(features.rotation[i, c] * (1.0 / np.pi) - seed[1])
            distance = rest + direct**2
            if distance < nearest:
                nearest, entry = distance, c
            distance = rest + crossed**2
            if distance < nearest_dual:
                nearest_dual, dual = distance, c + pairs
    if nearest_dual < nearest:
        return nearest_dual, dual
    return nearest, entry


@kernel
def _place_best(growth: FuzzyGrowth) -> None:
    """Put the best vector of a step into the FMAP and begin the next step."""
    entries, columns, _, _, state, strength = growth
    row, entry = state[3], state[4]
    free = columns.size - state[0]
    place = 0
    while columns[place] != entry % columns.size:
        place += 1
    for k in range(place, free - 1):
        columns[k] = columns[k + 1]
    entries[row] = entry
    strength[0] = 1.0 if state[0] == 0 else strength[1] / state[0]
    strength[1] = -1.0
    strength[2] = np.inf
    state[0] += 1
    state[1] = 0
    state[2] = row


@kernel
def _add_closeness(
    i: int,
    growth: FuzzyGrowth,
    features: Features,
    membership: Membership,
    store: ClosenessStore,
) -> None:
    """Add what the vector placed last means to row i, and see if the best of the row is better."""
    entries, columns, close, apart, state, strength = growth
    pairs = columns.size
    row, column = state[2], entries[state[2]] % pairs
    known = store.places[row * pairs + column] if len(store.values) > 0 else -1
    # Of a dual, the closeness to a vector is that of its opposite to the vector's dual.
    plane = 1 if entries[row] >= pairs else 0
    for dual in range(2):
        for k in range(pairs - state[0]):
            c = columns[k]
            if known >= 0:
                odds = store.values[known, plane ^ dual, i * pairs + c]
            else:
                odds = _odds_apart(features, membership, row, column, i, c, plane ^ dual)
            mine = strength[0] / (1.0 + odds)
            rest = mine * odds
            if state[0] > 1:
                mine += close[i, dual, c]
                rest += apart[i, dual, c]
            close[i, dual, c] = mine
            apart[i, dual, c] = rest
            near = strength[2] < strength[1]
            if rest < strength[2] if near else mine > strength[1]:
                strength[1], strength[2] = mine, rest
                state[3], state[4] = i, c + dual * pairs


@kernel
def _fill(number: int, features: Features, membership: Membership, store: ClosenessStore) -> None:
    """Make the closeness of one vector to all others known."""
    rows, pairs = features.similarity.shape
    place = store.used[0]
    for dual in range(2):
        for other in range(rows * pairs):
            store.values[place, dual, other] = _odds_apart(
                features,
                membership,
                number // pairs,
                number % pairs,
                other // pairs,
                other % pairs,
                dual,
            )
    store.places[number] = place
    store.used[0] += 1


@kernel
def _odds_apart(
    features: Features, membership: Membership, row: int, column: int, i: int, c: int, dual: int
) -> float:
    """Return 1/μ_close − 1 of a vector and another or, if ``dual`` is 1, the other's dual."""
    distance = _distances(features, row, column, i, c)[dual]
    exponent = membership.steepness * (distance - membership.centre)
    odds: float = np.exp(min(exponent, _LARGEST_EXPONENT))
    return odds


@kernel
def _distances(features: Features, row: int, column: int, i: int, c: int) -> tuple[float, float]:
    """Return the distance of two vectors, and of one from the other's dual."""
    rest = (features.similarity[row, column] - features.similarity[i, c]) ** 2
    rest += (features.level[row, column] - features.level[i, c]) ** 2
    if features.folded:
        turn = _folded(features.rotation[row, column])
        other = _folded(features.rotation[i, c])
        direct, crossed = turn - other, turn - (1.0 - other)
    else:
        turned = features.rotation[row, column] - features.rotation[i, c]
        direct, crossed = _around(turned * (1.0 / np.pi))
    return np.sqrt(rest + direct * direct), np.sqrt(rest + crossed * crossed)


@kernel
def _around(difference: float) -> tuple[float, float]:
    """Return how far two circular R̂ are apart that differ so, and one and the other's dual."""
    direct = abs(difference - 2.0 * np.floor(0.5 * difference + 0.5))
    return direct, 1.0 - direct


@kernel
def _folded(rotation: float) -> float:
    """Return R̂ of R within [0, 2π)."""
    return 1.0 - abs(1.0 - rotation * (1.0 / np.pi))
