"""Cells of rotation and dilation, in each of which ζ is bounded by a sum over pairs.

Let P be the number of template pairs, W = w1 + w2 + w3, and call 1 − ζ the loss of an object map.

- |Σ ω e^{iR}| = Σ ω cos(R − θ) where θ is the direction of the sum and ω are the rotation weights,
  1 on average. If θ lies in [θ1, θ2], no pair contributes more than ω times the greatest cosine
  over the cell, cosmax.
- With F(t) the share of the L̂ up to t, δL = (P/(P − 1)) 2 ∫ F(1 − F) dt. A cell says of some
  quantiles of the L̂ in which intervals they lie, and so in which interval [l, h] each F(t) lies.
  There F(1 − F) is nowhere below its chord F(1 − l − h) + l h, which is linear in F: the integral
  is at least the mean of a convex, piecewise linear function φ of the L̂, and a constant of the
  cell. (With the median alone φ is the distance to its interval, as in δL ≥ (P/(P − 1)) mean
  |L̂ − median|. Two quantiles leave less than half of what that loses.)
- 1 − 2^{−δ} is concave, so between the constant d of the cell and any greater D it is at least
  1 − 2^{−d} + s·(δ − d) with the slope of its chord, s = (2^{−d} − 2^{−D})/(D − d). A map with
  δL > D loses more than w3 (1 − 2^{−D})/W in dilation alone, so none better than the incumbent ζ°
  is excluded by D = −log2(1 − (1 − ζ°) W/w3); nor does δL ever exceed the spread of all L̂.

So every map that is better than the incumbent and whose θ and quantiles lie in the cell loses at
least a base of w3 (1 − 2^{−d})/W and the sum of

    w1 (1 − e)/(W P) + w2 ω (1 − cosmax)/(W P) + w3 s·φ(L̂)/(W (P − 1))

over its entries, where e is σ or the evidence in its place: a quadratic assignment problem. Every
θ and all quantiles are covered, so a bound for every cell is a bound for every map. With P = 1,
ζR = ζL = 1 and the first term is all.

A first bound for a cell gives half of the least cost of each entry (a, b) → (c, d) to a → c and
half to b → d, and solves the linear assignment problem of these (P. C. Gilmore, "Optimal and
suboptimal algorithms for the quadratic assignment problem", J. SIAM 10, 1962; E. L. Lawler, "The
quadratic assignment problem", Management Science 9, 1963). A candidate whose reduced cost alone
exceeds what may still be lost is dropped, in this cell and in all cells inside it.
"""

# ruff: noqa: PLR1730 (with its care for NaN, min() would make these loops take twice as long)

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sketchmatch.api.kernels import kernel
from sketchmatch.model import FloatArray, IntArray
from sketchmatch_builtin.searchers._assignment import FORBIDDEN, reduce_by_assignment
from sketchmatch_builtin.searchers._ranking import Ranking
from sketchmatch_builtin.searchers._relations import Relations, offer

__all__ = [
    "COSINE",
    "END",
    "EVALUATIONS",
    "FIRST_QUANTILE",
    "HALF",
    "HALF_COSINE",
    "HALF_SINE",
    "HIGH",
    "LOW",
    "MIDDLE",
    "NEXT",
    "PAIR",
    "QUANTILES",
    "ROTATION",
    "ROUNDING",
    "SINE",
    "TOLERANCE",
    "CellTerms",
    "Cells",
    "cell_terms",
    "divide_cells",
    "first_cell",
    "first_place",
    "halve",
    "list_candidates",
    "pair_costs",
    "room_for_costs",
    "tolerated",
]

TOLERANCE = 1e-9
"""A map counts as best if none is better by more than this."""

ROUNDING = 1e-11
"""More than rounding can add to a bound."""

QUANTILES = (0.3, 0.7)
"""Which quantiles of the L̂ cells are made of: shares of the L̂ below, in rising order."""

NEXT, END, PAIR, EVALUATIONS = range(4)
"""Where a division is: the next cell in the queue, its end, the next pair in that cell; and how
many maps were evaluated."""

ROTATION, FIRST_QUANTILE = range(2)
"""The sides of a box: θ, and then one for each of the :data:`QUANTILES`."""

MIDDLE, HALF = range(2)
"""What a box says of θ: its middle, and half of its width."""

LOW, HIGH = range(2)
"""What a box says of a quantile: the ends of its interval."""

COSINE, SINE, HALF_COSINE, HALF_SINE = range(4)
"""What the bounds in a cell take from its θ: of the middle, and of half the width."""


class CellTerms(NamedTuple):
    """What the bounds in a cell depend on.

    Attributes
    ----------
    similarity_rate, rotation_rate, dilation_rate
        What an entry loses for 1 − e, ω (1 − cosmax) and a unit of φ.
    base
        What any map of the cell loses beside its entries.
    turn
        Shape (4,): COSINE, SINE, HALF_COSINE and HALF_SINE; cos of half the width is −2 where it
        is all around.
    hinges
        Shape (2, h, 2): places and slopes of the hinges of φ to the left and to the right.
    """

    similarity_rate: float
    rotation_rate: float
    dilation_rate: float
    base: float
    turn: FloatArray
    hinges: FloatArray


class Cells(NamedTuple):
    """A queue of cells: those at the front are done with, and behind its end is room for more.

    Attributes
    ----------
    boxes
        Shape (room, 1 + K, 2): MIDDLE and HALF of θ, and for each of the K :data:`QUANTILES` LOW
        and HIGH, the ends of its interval, which rise from quantile to quantile.
    bounds
        Shape (room,): a bound of ζ in each cell; −∞ where the cell was halved.
    allowed
        Shape (room, N, N'): the candidates of the template objects in each cell.
    """

    boxes: FloatArray
    bounds: FloatArray
    allowed: NDArray[np.bool_]


def first_cell(shape: tuple[int, int], least: float, most: float) -> Cells:
    """Return the one cell that holds all maps.

    Parameters
    ----------
    shape
        N and N'.
    least, most
        Of all L̂.
    """
    box = np.array([(0.0, np.pi), *[(least, most)] * len(QUANTILES)])
    return Cells(box[None], np.ones(1), np.ones((1, *shape), dtype=np.bool_))


def first_place(evaluations: int) -> IntArray:
    """Return where a division begins, shape (4,): at the one cell that holds all maps."""
    place = np.zeros(4, dtype=np.int64)
    place[END], place[EVALUATIONS] = 1, evaluations
    return place


@kernel
def tolerated(found: Ranking) -> float:
    """Return the loss from which on nothing is better than the incumbent."""
    return 1.0 - float(found.values[0]) - TOLERANCE + ROUNDING


@kernel
def cell_terms(relations: Relations, incumbent: float, spread: float, box: FloatArray) -> CellTerms:
    """Return what the bounds in a cell depend on; ``spread`` is that of all L̂."""
    share_s, share_r, share_l = relations.shares
    count = relations.pairs.shape[0]
    hinges = np.zeros((2, 2 * (box.shape[0] - FIRST_QUANTILE), 2))
    rotation_rate = dilation_rate = base = 0.0
    if count > 1:
        rotation_rate = share_r / count
        most, room = spread, 1.0 - incumbent
        if room < share_l:
            most = min(most, -np.log2(1.0 - room / share_l))
        least = _write_hinges(box, hinges) * count / (count - 1.0)
        low, high = np.exp2(-least), np.exp2(-most)
        slope = (low - high) / (most - least) if most > least + 1e-6 else np.log(2.0) * high
        dilation_rate = share_l * slope / (count - 1.0)
        base = share_l * (1.0 - low)
    turn, (middle, half) = np.empty(4), box[ROTATION]
    turn[COSINE], turn[SINE] = np.cos(middle), np.sin(middle)
    turn[HALF_COSINE] = np.cos(half) if half < np.pi else -2.0
    turn[HALF_SINE] = np.sin(half)
    return CellTerms(share_s / count, rotation_rate, dilation_rate, base, turn, hinges)


@kernel
def _write_hinges(box: FloatArray, hinges: FloatArray) -> float:
    """Write the hinges of φ for a cell, and return its constant.

    Below the end of a quantile's interval F is no more than the quantile's share, above its
    beginning no less. Where l + h < 1 the chord is integrated in F, elsewhere in 1 − F; then φ is
    0 where the one goes over into the other, and no part of it negative.
    """
    ends = box[FIRST_QUANTILE:]
    count = ends.shape[0]
    low, high, least, most = 0, 0, 0.0, QUANTILES[0]
    constant, before, left, right = 0.0, ends[0, LOW], 0, 0
    while high < count:
        opens = low < count and ends[low, LOW] <= ends[high, HIGH]
        place = ends[low, LOW] if opens else ends[high, HIGH]
        total = least + most
        level = least * most if total < 1.0 else (1.0 - least) * (1.0 - most)
        constant += 2.0 * (place - before) * level
        before = place
        if opens:
            low += 1
            most = QUANTILES[low] if low < count else 1.0
        else:
            least = QUANTILES[high]
            high += 1
        now = least + most
        if total < 1.0:
            hinges[0, left, 0], hinges[0, left, 1] = place, 2.0 * (min(now, 1.0) - total)
            left += 1
        if now > 1.0:
            hinges[1, right, 0], hinges[1, right, 1] = place, 2.0 * (now - max(total, 1.0))
            right += 1
    return constant


@kernel
def pair_costs(
    relations: Relations, first: int, last: int, terms: CellTerms, costs: FloatArray
) -> None:
    """Write the least loss of each entry of some template pairs in a cell.

    Parameters
    ----------
    first, last
        The pairs are ``first`` to ``last`` − 1: one call for many is what makes this fast.
    costs
        Shape (last − first or more, Q').
    """
    rate_s, rate_r, rate_l = terms.similarity_rate, terms.rotation_rate, terms.dilation_rate
    turn_c, turn_s = terms.turn[COSINE], terms.turn[SINE]
    half_c, half_s = terms.turn[HALF_COSINE], terms.turn[HALF_SINE]
    hinges, half = terms.hinges, relations.cosine.shape[1]
    directed = relations.evidence.shape[1] > half
    for row in range(last - first):
        evidence, dilation = relations.evidence[first + row], relations.dilation[first + row]
        cosine, sine = relations.cosine[first + row], relations.sine[first + row]
        loss = costs[row, :half]
        for j in range(half):
            loss[j] = rate_s * (1.0 - evidence[j])
        for k in range(hinges.shape[1]):
            place, slope = hinges[0, k, 0], rate_l * hinges[0, k, 1]
            if slope > 0.0:
                for j in range(half):
                    away = place - dilation[j]
                    loss[j] += slope * away if away > 0.0 else 0.0
            place, slope = hinges[1, k, 0], rate_l * hinges[1, k, 1]
            if slope > 0.0:
                for j in range(half):
                    away = dilation[j] - place
                    loss[j] += slope * away if away > 0.0 else 0.0
        most = relations.rotation_weights[first + row]
        nearly = half_c * most
        for j in range(half):
            along = cosine[j] * turn_c + sine[j] * turn_s
            across = abs(sine[j] * turn_c - cosine[j] * turn_s) * half_s
            nearest = most if along >= nearly else along * half_c + across
            nearest_dual = most if -along >= nearly else across - along * half_c
            costs[row, half + j] = loss[j] + rate_r * (most - nearest_dual)
            costs[row, j] = loss[j] + rate_r * (most - nearest)
        if directed:
            for j in range(half):
                cost = costs[row, half + j] + rate_s * (evidence[j] - evidence[half + j])
                costs[row, half + j] = cost if cost > 0.0 else 0.0


@kernel
def room_for_costs(relations: Relations) -> FloatArray:
    """Return room for the costs of as many pairs as one should ask for at once."""
    entries = 2 * relations.cosine.shape[1]
    return np.empty((min(relations.pairs.shape[0], 1 + 4096 // entries), entries))


@kernel
def list_candidates(allowed: NDArray[np.bool_], candidates: IntArray, sizes: IntArray) -> None:
    """List what each object may be mapped to, from a table of shape (N, N')."""
    for a in range(allowed.shape[0]):
        count = 0
        for c in range(allowed.shape[1]):
            if allowed[a, c]:
                candidates[a, count] = c
                count += 1
        sizes[a] = count


@kernel
def divide_cells(
    relations: Relations,
    found: Ranking,
    spread: float,
    cells: Cells,
    leaders: FloatArray,
    smallest: FloatArray,
    place: IntArray,
    budget: int,
) -> int:
    """Bound the cells in a queue, offer the map of each one's assignment, and halve the open ones.

    Parameters
    ----------
    spread
        The greatest L̂ less the least.
    cells
        The queue, changed in place.
    leaders
        Shape (N, N'), room that must stay as it is between two calls.
    smallest
        Shape (1 + K,): half the widths in θ and in quantiles from which on a cell is not halved.
    place
        What :func:`first_place` returned, changed in place.
    budget
        Entries to cost in this call, which ends early where the queue needs more room.

    Returns
    -------
    int
        How many it costed.
    """
    objects, others = leaders.shape
    candidates = np.empty((objects, others), dtype=np.int64)
    sizes, partners = np.empty(objects, dtype=np.int64), np.empty(objects, dtype=np.int64)
    holders = np.empty(others, dtype=np.int64)
    costs, low = room_for_costs(relations), np.empty(others)
    work, pairs = 0, relations.pairs.shape[0]
    while place[NEXT] < place[END] and work < budget and place[END] + 2 <= cells.bounds.size:
        cell = place[NEXT]
        if 1.0 - cells.bounds[cell] + ROUNDING >= tolerated(found):
            place[NEXT] += 1
            continue
        list_candidates(cells.allowed[cell], candidates, sizes)
        if place[PAIR] == 0:
            leaders[:] = 0.0
        terms = cell_terms(relations, found.values[0], spread, cells.boxes[cell])
        while place[PAIR] < pairs and work < budget:
            first, last = place[PAIR], min(place[PAIR] + costs.shape[0], pairs)
            pair_costs(relations, first, last, terms, costs)
            _lead(relations, first, last, costs, candidates, sizes, leaders, low)
            work += costs.size
            place[PAIR] = last
        if place[PAIR] < pairs:
            return work
        place[NEXT] += 1
        place[PAIR] = 0
        bound = terms.base + reduce_by_assignment(leaders, candidates, sizes, holders)
        cells.bounds[cell] = min(cells.bounds[cell], 1.0 - bound + ROUNDING)
        if bound < tolerated(found):
            for c in range(others):
                if holders[c] >= 0:
                    partners[holders[c]] = c
            offer(relations, found, partners, found.values[0])
            place[EVALUATIONS] += 1
            room = tolerated(found) - bound
            for a in range(objects):
                for x in range(sizes[a]):
                    if leaders[a, x] >= room:
                        cells.allowed[cell, a, candidates[a, x]] = False
            halve(cells, cell, smallest, place)
    return work


@kernel
def _lead(
    relations: Relations,
    first: int,
    last: int,
    costs: FloatArray,
    candidates: IntArray,
    sizes: IntArray,
    leaders: FloatArray,
    low: FloatArray,
) -> None:
    """Give half of the least costs of some pairs' entries to either object's candidates.

    ``low`` is room for N' numbers.
    """
    pairs, columns = relations.pairs, relations.columns
    for i in range(first, last):
        a, b = pairs[i, 0], pairs[i, 1]
        for y in range(sizes[b]):
            low[y] = FORBIDDEN
        for x in range(sizes[a]):
            c = candidates[a, x]
            least = FORBIDDEN
            for y in range(sizes[b]):
                d = candidates[b, y]
                if c != d:
                    cost = costs[i - first, columns[c, d]]
                    if cost < least:
                        least = cost
                    if cost < low[y]:
                        low[y] = cost
            leaders[a, x] += 0.5 * least
        for y in range(sizes[b]):
            leaders[b, y] += 0.5 * low[y]


@kernel
def halve(cells: Cells, cell: int, smallest: FloatArray, place: IntArray) -> None:
    """Replace a cell by its halves at the end of the queue, if it is too wide.

    ``smallest`` and ``place`` are those of :func:`divide_cells`; there must be room for two cells.
    """
    boxes = cells.boxes
    widest, excess = -1, 1.0
    for side in range(smallest.size):
        half = boxes[cell, ROTATION, HALF]
        if side != ROTATION:
            half = 0.5 * (boxes[cell, side, HIGH] - boxes[cell, side, LOW])
        if half > excess * smallest[side]:
            widest, excess = side, half / smallest[side]
    if widest < 0:
        return
    for upper in range(2):
        new = place[END]
        box = boxes[new]
        box[:] = boxes[cell]
        if widest == ROTATION:
            box[ROTATION, MIDDLE] += (upper - 0.5) * boxes[cell, ROTATION, HALF]
            box[ROTATION, HALF] *= 0.5
        else:
            middle = 0.5 * (box[widest, LOW] + box[widest, HIGH])
            box[widest, LOW if upper else HIGH] = middle
        # The quantiles rise. That never leaves an interval empty: its ends rise as well.
        for side in range(FIRST_QUANTILE + 1, smallest.size):
            box[side, LOW] = max(box[side, LOW], box[side - 1, LOW])
        for side in range(smallest.size - 2, ROTATION, -1):
            box[side, HIGH] = min(box[side, HIGH], box[side + 1, HIGH])
        cells.bounds[new] = cells.bounds[cell]
        cells.allowed[new] = cells.allowed[cell]
        place[END] += 1
    cells.bounds[cell] = -np.inf
