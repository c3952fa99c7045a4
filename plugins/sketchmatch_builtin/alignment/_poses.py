"""Poses of a sketch on a map, compiled: guessed from two pairings, weighed, and refined.

A pose is w = u·z + t in complex numbers. Under it sketched object i is mapped object j with

    ℓ_ij = −2 ln[(1 + d²/3)(1 + e²/3)(1 + h²/3)],

the logarithm of a product of Student's t with 3 degrees of freedom [1]_ but for a constant: d, e
and h are the distance of the places, the difference of the logarithms of the areas, and that of
the shapes, each over its tolerance. A pose is worth Σ_i max(max_j ℓ_ij, −λ).

References
----------
.. [1] K. Lange, R. Little, J. Taylor, "Robust statistical modeling using the t distribution",
   Journal of the American Statistical Association 84, 1989.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sketchmatch.api.kernels import kernel
from sketchmatch.model import BoolArray, FloatArray, IntArray
from sketchmatch_builtin.alignment._things import Things
from sketchmatch_builtin.searchers._assignment import FORBIDDEN, reduce_by_assignment

__all__ = [
    "TOLERANCES",
    "Grid",
    "Guesses",
    "Tolerances",
    "empty_guesses",
    "far_pairs",
    "fitted_pose",
    "fitting_pose",
    "grid_of",
    "grown",
    "guess_poses",
    "guessed_pose",
    "pair_score",
    "pairing_worths",
    "refine_guesses",
    "refine_pose",
    "square",
    "vary",
]

_ROUNDS = 6
_MOST_CELLS = 64
_FULL = 1e3
_LOOKS = 500
"""Pairings to look at for each pose that may be weighed between two pauses."""

_REACH = 3.0
"""Tolerances that sizes and shapes of two pairings may differ by to make a pose."""

_LARGEST, _SMALLEST = -1.0, 2.0
"""How much, in ln of the area, things may grow beyond what their places do: a sketch may show all
of them smaller between their places, and hardly larger."""

_TRUST = 0.9
"""Of that, how much two pairings are believed."""

_SPREAD = 0.6
"""Its standard deviation among sketches."""


class Tolerances(NamedTuple):
    """How far sketches leave the truth.

    Attributes
    ----------
    place
        Of places, in units of the sketch's spacing under the pose.
    size
        Of ln of the areas.
    shape
        Of shapes.
    omission
        λ, what leaving a sketched object without partner costs.
    """

    place: float
    size: float
    shape: float
    omission: float


TOLERANCES = Tolerances(place=0.35, size=0.35, shape=0.35, omission=5.0)
"""Wide enough for anybody's sketch; judging is not theirs."""


class Grid(NamedTuple):
    """Objects by the cells of a grid in which they lie.

    Attributes
    ----------
    corner
        x + iy of the first cell's corner.
    cell
        Width of a cell.
    columns, rows
        How many cells there are.
    starts
        int64, shape (columns·rows + 1,): cell c, counted row by row, holds the objects
        ``starts[c]`` to ``starts[c + 1]`` − 1 of:
    things
        The objects, sorted by cell.
    order
        int64, shape (m,): which each of these is.
    """

    corner: complex
    cell: float
    columns: int
    rows: int
    starts: IntArray
    things: Things
    order: IntArray


class Guesses(NamedTuple):
    """Good poses met.

    Attributes
    ----------
    scores
        Shape (room,).
    pairings
        int64, shape (room, 4): i, j, k and g of a pose that lays i on j and k on g.
    state
        int64, shape (3,): how many there are, how many were weighed, and how many pairs of a
        sketched pair and a mapped object are done.
    floor
        Shape (1,): what a pose must be worth to be kept.
    """

    scores: FloatArray
    pairings: IntArray
    state: IntArray
    floor: FloatArray


def grid_of(things: Things) -> Grid:
    """Return objects by cells, about one in each."""
    x, y = things.places.real, things.places.imag
    width, height = float(np.ptp(x)), float(np.ptp(y))
    cell = max(math.sqrt(width * height / len(x)), max(width, height) / _MOST_CELLS, things.spacing)
    columns, rows = int(width / cell) + 1, int(height / cell) + 1
    number = ((y - y.min()) / cell).astype(np.int64) * columns
    number += ((x - x.min()) / cell).astype(np.int64)
    order = np.argsort(number, kind="stable")
    starts = np.searchsorted(number[order], np.arange(columns * rows + 1))
    sorted_ = Things(
        things.places[order], things.sizes[order], things.shapes[order], things.spacing
    )
    return Grid(complex(x.min(), y.min()), cell, columns, rows, starts, sorted_, order)


def empty_guesses(room: int, floor: float) -> Guesses:
    """Return room for an even number of guesses that are worth more than a floor."""
    return Guesses(
        np.empty(room),
        np.empty((room, 4), dtype=np.int64),
        np.zeros(3, dtype=np.int64),
        np.full(1, floor),
    )


@kernel
def guess_poses(
    pairs: IntArray,
    drawn: Things,
    mapped: Things,
    grid: Grid,
    allowed: FloatArray,
    tolerances: Tolerances,
    most: int,
    guesses: Guesses,
) -> None:
    """Go on weighing the poses that lay each sketched pair on every ordered pair of mapped objects.

    Parameters
    ----------
    pairs
        Shape (p, 2), sketched pairs.
    drawn, mapped, grid
        The objects, and the mapped ones by cells.
    allowed
        Shape (n, m): 0 where a pairing is ruled out.
    tolerances
        How far sketches leave the truth.
    most
        How many to weigh before a pause, or a few more.
    guesses
        Where good poses are kept, and how far this has come.
    """
    m = mapped.places.size
    free = np.empty((drawn.places.size, m), dtype=np.bool_)
    for i in range(drawn.places.size):
        for x in range(m):
            free[i, x] = allowed[i, grid.order[x]] > 0.0
    wide, limit = _REACH * tolerances.size, (_REACH * tolerances.shape) ** 2
    until, end = guesses.state[1] + most, guesses.state[2] + max(1, _LOOKS * most // m)
    while guesses.state[2] < min(pairs.shape[0] * m, end) and guesses.state[1] < until:
        i, k = pairs[guesses.state[2] // m, 0], pairs[guesses.state[2] // m, 1]
        j = guesses.state[2] % m
        guesses.state[2] += 1
        apart = drawn.places[k] - drawn.places[i]
        if square(apart) == 0.0 or allowed[i, j] == 0.0:
            continue
        larger = mapped.sizes[j] - drawn.sizes[i]
        for g in range(m):
            if g == j or allowed[k, g] == 0.0:
                continue
            if abs(mapped.sizes[g] - drawn.sizes[k] - larger) > wide:
                continue
            u = (mapped.places[g] - mapped.places[j]) / apart
            if square(u) == 0.0:
                continue
            growth = np.log(square(u))
            mean = 0.5 * (larger + mapped.sizes[g] - drawn.sizes[k]) - growth
            if not _LARGEST <= mean <= _SMALLEST:
                continue
            twist = u * u / square(u)
            if (
                square(drawn.shapes[i] * twist - mapped.shapes[j]) > limit
                or square(drawn.shapes[k] * twist - mapped.shapes[g]) > limit
            ):
                continue
            guesses.state[1] += 1
            growth += _TRUST * mean
            t = mapped.places[j] - u * drawn.places[i]
            score = _worth(u, t, twist, growth, drawn, grid, free, tolerances, guesses.floor[0])
            if score > guesses.floor[0]:
                _keep(guesses, score, i, j, k, g)


@kernel
def far_pairs(places: NDArray[np.complex128], most: int) -> IntArray:
    """Return so many pairs of places at most, shape (k, 2): far ones first, and each place soon."""
    n = places.size
    count = n * (n - 1) // 2
    apart, used = np.empty((n, n)), np.zeros(n)
    for i in range(n):
        for j in range(i + 1, n):
            apart[i, j] = abs(places[i] - places[j])
    found = np.empty((min(count, most), 2), dtype=np.int64)
    for x in range(found.shape[0]):
        best, a, b = -1.0, 0, 0
        for i in range(n):
            for j in range(i + 1, n):
                value = apart[i, j] / (1.0 + used[i] + used[j])
                if value > best:
                    best, a, b = value, i, j
        found[x, 0], found[x, 1] = a, b
        used[a] += 1.0
        used[b] += 1.0
        apart[a, b] = -np.inf
    return found


@kernel
def guessed_pose(
    pairing: IntArray, drawn: Things, mapped: Things
) -> tuple[complex, complex, float]:
    """Return the pose that lays i on j and k on g, and by how much ln of the areas grows."""
    i, j, k, g = pairing[0], pairing[1], pairing[2], pairing[3]
    u = (mapped.places[g] - mapped.places[j]) / (drawn.places[k] - drawn.places[i])
    growth = np.log(square(u))
    larger = mapped.sizes[j] - drawn.sizes[i] + mapped.sizes[g] - drawn.sizes[k]
    growth += _TRUST * (0.5 * larger - growth)
    return u, mapped.places[j] - u * drawn.places[i], growth


def fitting_pose(
    partners: IntArray, drawn: Things, mapped: Things
) -> tuple[complex, complex, float] | None:
    """Return the pose that lays all objects of a map on their partners as well as may be.

    Returns
    -------
    tuple or None
        The pose, and by how much ln of the areas grows; None where the map tells of none.
    """
    (matched,) = np.nonzero(partners >= 0)
    if len(matched) < 2:
        return None
    here, there = drawn.places[matched], mapped.places[partners[matched]]
    z, w = here - here.mean(), there - there.mean()
    spread = float((np.abs(z) ** 2).sum())
    u = complex((w * z.conj()).sum() / spread) if spread > 0.0 else 0.0j
    if u == 0.0:
        return None
    growth = grown(drawn, mapped, partners, 2.0 * math.log(abs(u)), TOLERANCES)
    return u, complex(there.mean() - u * here.mean()), growth


@kernel
def square(z: complex) -> float:
    """Return |z|², of which numba knows no quick form."""
    return z.real * z.real + z.imag * z.imag


@kernel
def _units(u: complex, drawn: Things, tolerances: Tolerances) -> tuple[float, float, float]:
    """Return what squares of deviations count for, 1/(3κ²): of places, sizes and shapes."""
    return (
        1.0 / (3.0 * square(u) * (tolerances.place * drawn.spacing) ** 2),
        1.0 / (3.0 * tolerances.size**2),
        1.0 / (3.0 * tolerances.shape**2),
    )


@kernel
def _unlike(
    place: complex,
    size: float,
    shape: complex,
    mapped: Things,
    j: int,
    units: tuple[float, float, float],
) -> float:
    """Return exp(−ℓ/2) of what lies there under a pose and a mapped object."""
    unlike = 1.0 + units[0] * square(mapped.places[j] - place)
    unlike *= 1.0 + units[1] * (mapped.sizes[j] - size) ** 2
    unlike *= 1.0 + units[2] * square(shape - mapped.shapes[j])
    return float(unlike)


@kernel
def pair_score(
    u: complex,
    t: complex,
    growth: float,
    drawn: Things,
    i: int,
    mapped: Things,
    j: int,
    tolerances: Tolerances,
) -> float:
    """Return ℓ of a pairing under a pose."""
    place, size = u * drawn.places[i] + t, drawn.sizes[i] + growth
    units, shape = _units(u, drawn, tolerances), drawn.shapes[i] * (u * u / square(u))
    return float(-2.0 * np.log(_unlike(place, size, shape, mapped, j, units)))


@kernel
def _worth(
    u: complex,
    t: complex,
    twist: complex,
    growth: float,
    drawn: Things,
    grid: Grid,
    free: BoolArray,
    tolerances: Tolerances,
    floor: float,
) -> float:
    """Return what a pose is worth, or the floor where it is not above that."""
    unit, by_size, by_shape = _units(u, drawn, tolerances)
    worst = np.exp(0.5 * tolerances.omission)
    far, things = (worst - 1.0) / unit, grid.things
    reach = np.sqrt(far) / grid.cell
    most, total, product = -0.5 * floor, 0.0, 1.0
    for i in range(drawn.places.size):
        place, size = u * drawn.places[i] + t, drawn.sizes[i] + growth
        shape = drawn.shapes[i] * twist
        best = worst
        column = (place.real - grid.corner.real) / grid.cell
        row = (place.imag - grid.corner.imag) / grid.cell
        left, right = max(0.0, np.floor(column - reach)), min(grid.columns - 1.0, column + reach)
        low, high = max(0.0, np.floor(row - reach)), min(grid.rows - 1.0, row + reach)
        if left <= right and low <= high:
            for y in range(int(low), int(high) + 1):
                first = grid.starts[y * grid.columns + int(left)]
                last = grid.starts[y * grid.columns + int(right) + 1]
                for x in range(first, last):
                    away = square(things.places[x] - place)
                    if away < far:
                        unlike = 1.0 + unit * away
                        unlike *= 1.0 + by_size * (things.sizes[x] - size) ** 2
                        if unlike < best and free[i, x]:
                            unlike *= 1.0 + by_shape * square(shape - things.shapes[x])
                            best = min(best, unlike)
        product *= best
        if product > _FULL or i == drawn.places.size - 1:
            total, product = total + np.log(product), 1.0
            if total >= most:
                return floor
    return -2.0 * total


@kernel
def _keep(guesses: Guesses, score: float, i: int, j: int, k: int, g: int) -> None:
    """Keep a guess; where there is no room left, the better half alone stays."""
    count = guesses.state[0]
    guesses.scores[count] = score
    guesses.pairings[count, 0], guesses.pairings[count, 1] = i, j
    guesses.pairings[count, 2], guesses.pairings[count, 3] = k, g
    count += 1
    if count == guesses.scores.size:
        count //= 2
        best = _ranked(guesses.scores)
        scores, pairings = guesses.scores.copy(), guesses.pairings.copy()
        for place in range(count):
            guesses.scores[place] = scores[best[place]]
            for column in range(pairings.shape[1]):
                guesses.pairings[place, column] = pairings[best[place], column]
        guesses.floor[0] = guesses.scores[count - 1]
    guesses.state[0] = count


@kernel
def _ranked(scores: FloatArray) -> IntArray:
    """Return places by falling score, those with the same in their order.

    A merge sort: numba's, and its indexing by arrays, would take six seconds to compile.
    """
    places, merged = np.arange(scores.size), np.empty(scores.size, dtype=np.int64)
    width = 1
    while width < scores.size:
        for first in range(0, scores.size, 2 * width):
            left, right = first, min(first + width, scores.size)
            middle, end = right, min(first + 2 * width, scores.size)
            for place in range(first, end):
                from_left = right == end
                if left < middle and right < end:
                    from_left = scores[places[left]] >= scores[places[right]]
                if from_left:
                    merged[place] = places[left]
                    left += 1
                else:
                    merged[place] = places[right]
                    right += 1
        places, merged = merged, places
        width *= 2
    return places


@kernel
def refine_pose(
    u: complex,
    t: complex,
    growth: float,
    drawn: Things,
    mapped: Things,
    bonus: FloatArray,
    tolerances: Tolerances,
    partners: IntArray,
) -> tuple[complex, complex, float, float]:
    """Assign under a pose, fit the pose to what was assigned, and so on until nothing changes.

    Parameters
    ----------
    u, t, growth
        The pose, and by how much ln of the areas grows.
    drawn, mapped, tolerances
        As for :func:`guess_poses`.
    bonus
        Shape (n, m): what speaks for each pairing beside place, size and shape; −inf rules it out.
    partners
        Shape (n,), written: the mapped object of each sketched one, −1 for none.

    Returns
    -------
    complex, complex, float, float
        The pose and the growth, and the sum of ℓ and −λ under them.
    """
    n, m = drawn.places.size, mapped.places.size
    costs, candidates = np.empty((n, m + 1)), np.empty((n, m + 1), dtype=np.int64)
    sizes, holders = np.empty(n, dtype=np.int64), np.empty(m + n, dtype=np.int64)
    former = np.empty(n, dtype=np.int64)
    total = 0.0
    for x in range(_ROUNDS):
        weigh_pairings(u, t, growth, drawn, mapped, bonus, tolerances, costs, candidates, sizes)
        total = -reduce_by_assignment(costs, candidates, sizes, holders)
        for i in range(n):
            partners[i] = -1
        for j in range(m):
            if holders[j] >= 0:
                partners[holders[j]] = j
        changed = x == 0
        for i in range(n):
            changed |= partners[i] != former[i]
            former[i] = partners[i]
        if not changed:
            break
        v, s = fitted_pose(u, t, drawn, mapped, tolerances, partners)
        if v == 0.0:
            break
        u, t = v, s
        growth = grown(drawn, mapped, partners, 2.0 * np.log(abs(u)), tolerances)
    return u, t, growth, total


@kernel
def refine_guesses(
    pairings: IntArray,
    drawn: Things,
    mapped: Things,
    bonus: FloatArray,
    tolerances: Tolerances,
    partners: IntArray,
    poses: NDArray[np.complex128],
    values: FloatArray,
) -> None:
    """Refine several guessed poses, as :func:`refine_pose` does each.

    Parameters
    ----------
    pairings
        Shape (k, 4), as in :class:`Guesses`.
    drawn, mapped, bonus, tolerances
        As for :func:`refine_pose`.
    partners
        Shape (k, n), written: the mapped object of each sketched one, −1 for none.
    poses
        Shape (k, 2), written: u and t.
    values
        Shape (k, 2), written: the growth, and the sum of ℓ and −λ.
    """
    for x in range(pairings.shape[0]):
        u, t, growth = guessed_pose(pairings[x], drawn, mapped)
        u, t, growth, score = refine_pose(
            u, t, growth, drawn, mapped, bonus, tolerances, partners[x]
        )
        poses[x, 0], poses[x, 1] = u, t
        values[x, 0], values[x, 1] = growth, score


@kernel
def grown(
    drawn: Things, mapped: Things, partners: IntArray, growth: float, tolerances: Tolerances
) -> float:
    """Return by how much ln of the areas grows: what the pose says, and things say otherwise."""
    offset = 0.0
    for _ in range(3):
        total, weight = 0.0, (tolerances.size / _SPREAD) ** 2
        for i in range(partners.size):
            if partners[i] >= 0:
                e = mapped.sizes[partners[i]] - drawn.sizes[i] - growth
                share = 1.0 / (1.0 + ((e - offset) / tolerances.size) ** 2 / 3.0)
                total += share * e
                weight += share
        offset = total / weight
    return growth + offset


@kernel
def weigh_pairings(
    u: complex,
    t: complex,
    growth: float,
    drawn: Things,
    mapped: Things,
    bonus: FloatArray,
    tolerances: Tolerances,
    costs: FloatArray,
    candidates: IntArray,
    sizes: IntArray,
) -> None:
    """Write −ℓ of the pairings that are better than leaving out, which comes last in each row."""
    n, m = drawn.places.size, mapped.places.size
    units, twist = _units(u, drawn, tolerances), u * u / square(u)
    worst = np.exp(0.5 * tolerances.omission)
    for i in range(n):
        place, size = u * drawn.places[i] + t, drawn.sizes[i] + growth
        shape, count = drawn.shapes[i] * twist, 0
        for j in range(m):
            unlike = _unlike(place, size, shape, mapped, j, units)
            if bonus[i, j] == 0.0 and unlike >= worst:
                continue
            cost = 2.0 * np.log(unlike) - bonus[i, j]
            if cost < tolerances.omission:
                costs[i, count], candidates[i, count] = cost, j
                count += 1
        costs[i, count], candidates[i, count] = min(tolerances.omission, FORBIDDEN / 2), m + i
        sizes[i] = count + 1


@kernel
def fitted_pose(
    u: complex,
    t: complex,
    drawn: Things,
    mapped: Things,
    tolerances: Tolerances,
    partners: IntArray,
) -> tuple[complex, complex]:
    """Return the pose that fits pairings best, each weighed by how well it fits; 0 if none."""
    unit = _units(u, drawn, tolerances)[0]
    weight, before, after = 0.0, 0.0j, 0.0j
    count = 0
    for i in range(partners.size):
        if partners[i] >= 0:
            away = mapped.places[partners[i]] - u * drawn.places[i] - t
            share = 1.0 / (1.0 + unit * square(away))
            weight += share
            before += share * drawn.places[i]
            after += share * mapped.places[partners[i]]
            count += 1
    if count < 2:
        return 0.0j, 0.0j
    before, after = before / weight, after / weight
    product, spread = 0.0j, 0.0
    for i in range(partners.size):
        if partners[i] >= 0:
            away = mapped.places[partners[i]] - u * drawn.places[i] - t
            share = 1.0 / (1.0 + unit * square(away))
            z, w = drawn.places[i] - before, mapped.places[partners[i]] - after
            product += share * w * z.conjugate()
            spread += share * square(z)
    if spread <= 0.0 or product == 0.0:
        return 0.0j, 0.0j
    v = product / spread
    return v, after - v * before


@kernel
def pairing_worths(
    u: complex,
    t: complex,
    growth: float,
    drawn: Things,
    mapped: Things,
    bonus: FloatArray,
    tolerances: Tolerances,
) -> FloatArray:
    """Return ℓ of every pairing under a pose, shape (n, m)."""
    n, m = drawn.places.size, mapped.places.size
    units, twist = _units(u, drawn, tolerances), u * u / square(u)
    worths = np.empty((n, m))
    for i in range(n):
        place, size = u * drawn.places[i] + t, drawn.sizes[i] + growth
        shape = drawn.shapes[i] * twist
        for j in range(m):
            unlike = _unlike(place, size, shape, mapped, j, units)
            worths[i, j] = bonus[i, j] - 2.0 * np.log(unlike)
    return worths


@kernel
def vary(
    worths: FloatArray,
    omission: float,
    partners: IntArray,
    loss: float,
    maps: IntArray,
    losses: FloatArray,
) -> int:
    """Write the maps that one change makes of a map at a loss of at most so much.

    A change gives an object another partner, or none; whoever has that partner takes the first
    one's in exchange, or what else is free, or none.
    """
    n, m = worths.shape
    holders = np.full(m, -1)
    for i in range(n):
        if partners[i] >= 0:
            holders[partners[i]] = i
    count = 0
    for i in range(n):
        now = worths[i, partners[i]] if partners[i] >= 0 else -omission
        for j in range(-1, m):
            if j == partners[i] or count >= losses.size:
                continue
            after = worths[i, j] if j >= 0 else -omission
            change = after - now
            k = holders[j] if j >= 0 else -1
            if k < 0:
                if change >= -loss:
                    _write(maps[count], partners, i, j)
                    losses[count] = -change
                    count += 1
                continue
            change -= worths[k, j]
            for g in range(-1, m):
                if count >= losses.size:
                    break
                if g >= 0 and holders[g] >= 0 and g != partners[i]:  # j is held too, by k
                    continue
                if g >= 0 and g == partners[i] and i > k:
                    continue
                whole = change + (worths[k, g] if g >= 0 else -omission)
                if whole >= -loss:
                    _write(maps[count], partners, i, j)
                    maps[count, k], losses[count] = g, -whole
                    count += 1
    return count


@kernel
def _write(changed: IntArray, partners: IntArray, i: int, j: int) -> None:
    """Write a map in which object i has partner j."""
    for x in range(partners.size):
        changed[x] = partners[x]
    changed[i] = j
