"""Quadratic assignment problems as they get smaller in a search, and their bounds.

A node of the search tree, at some level, is what is left of the problem of a cell: a bound K, a
leader r(a, c) for every candidate c of every open object a, and a block of residual costs
q(a, c, b, d) for every pair of open objects. Any map p within the node loses at least

    K + Σ_a r(a, p(a)) + Σ_{a<b} q(a, p(a), b, p(b)),    r, q ≥ 0.

Dual ascent (P. Hahn and T. Grant, "Lower bounds for the quadratic assignment problem based upon a
dual formulation", Operations Research 46, 1998) changes the terms but not the sums: a leader is
given back to its blocks in equal parts; from each block the minima of its rows and columns are
extracted, one half of a row's minimum, all of a column's, the rest of the row's, and are the new
leaders; and the value of the linear assignment problem of the leaders moves into K, which leaves
their reduced costs. A candidate with K + r at or above the loss of the incumbent is dropped.

To fix a → c adds r(a, c) to K and q(a, c, b, d) to r(b, d).
"""

# ruff: noqa: PLR1730 (with its care for NaN, min() would make these loops take twice as long)

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sketchmatch.api.kernels import kernel
from sketchmatch.model import FloatArray, IntArray, pair_count
from sketchmatch_builtin.searchers._assignment import FORBIDDEN, reduce_by_assignment
from sketchmatch_builtin.searchers._cells import (
    CellTerms,
    list_candidates,
    pair_costs,
    room_for_costs,
)
from sketchmatch_builtin.searchers._relations import Relations

__all__ = ["Tree", "assign", "empty_tree", "fix", "plant", "sweep"]

_MOST_COSTS = 24_000_000
_MOST_ROOT_COSTS = 4_000_000
_NEVER = 4.0 * FORBIDDEN


class Tree(NamedTuple):
    """The nodes from the root of a search tree to the present one, a level each.

    Attributes
    ----------
    counts, ends, branches
        Shape (levels,): the number of open objects, where the blocks of the level end in
        ``blocks``, and which open object the node branches on.
    bounds
        Shape (levels,): K.
    objects, sizes
        Shape (levels, N): the open objects, and how many candidates they have.
    candidates, leaders
        Shape (levels, N, N'): the candidates and r of each.
    starts
        Shape (levels, N, N): where the block of the k-th and a later open object starts:
        a matrix, row by row, of the candidates of the one and the other.
    blocks
        All residual costs q.
    partners
        Shape (N,): the map, where it is fixed, and the last assignment where it is open.
    """

    counts: IntArray
    ends: IntArray
    branches: IntArray
    bounds: FloatArray
    objects: IntArray
    sizes: IntArray
    candidates: IntArray
    leaders: FloatArray
    starts: IntArray
    blocks: FloatArray
    partners: IntArray


def empty_tree(template_objects: int, argument_objects: int) -> Tree:
    """Return room for a tree; the memory is taken as it is written to."""
    n, m, levels = template_objects, argument_objects, template_objects + 1
    root = min(pair_count(n) * m * m, _MOST_ROOT_COSTS)
    return Tree(
        counts=np.zeros(levels, dtype=np.int64),
        ends=np.zeros(levels, dtype=np.int64),
        branches=np.zeros(levels, dtype=np.int64),
        bounds=np.zeros(levels),
        objects=np.zeros((levels, n), dtype=np.int64),
        sizes=np.zeros((levels, n), dtype=np.int64),
        candidates=np.empty((levels, n, m), dtype=np.int64),
        leaders=np.empty((levels, n, m)),
        starts=np.zeros((levels, n, n), dtype=np.int64),
        blocks=np.empty(min(root * (n // 3 + 2), _MOST_COSTS)),
        partners=np.zeros(n, dtype=np.int64),
    )


@kernel
def plant(
    relations: Relations,
    tree: Tree,
    terms: CellTerms,
    allowed: NDArray[np.bool_],
) -> bool:
    """Make the problem of a cell the root of the tree; return False if there is no room for it."""
    sizes, candidates, starts, blocks = tree.sizes, tree.candidates, tree.starts, tree.blocks
    pairs, columns = relations.pairs, relations.columns
    list_candidates(allowed, candidates[0], sizes[0])
    tree.counts[0] = allowed.shape[0]
    tree.bounds[0] = 0.0
    costs, end, room = room_for_costs(relations), 0, min(blocks.size, _MOST_ROOT_COSTS)
    for a in range(allowed.shape[0]):
        tree.objects[0, a] = a
        for x in range(sizes[0, a]):
            tree.leaders[0, a, x] = 0.0
    for pair in range(pairs.shape[0]):
        row = pair % costs.shape[0]
        if row == 0:
            last = min(pair + costs.shape[0], pairs.shape[0])
            pair_costs(relations, pair, last, terms, costs)
        a, b = pairs[pair, 0], pairs[pair, 1]
        starts[0, a, b] = end
        if end + sizes[0, a] * sizes[0, b] > room:
            return False
        for x in range(sizes[0, a]):
            c = candidates[0, a, x]
            for y in range(sizes[0, b]):
                d = candidates[0, b, y]
                blocks[end] = FORBIDDEN if c == d else costs[row, columns[c, d]]
                end += 1
    tree.ends[0] = end
    return True


@kernel
def assign(tree: Tree, level: int, limit: float) -> bool:
    """Raise K by a linear assignment, drop hopeless candidates, and say if the node is open."""
    count, sizes, leaders = tree.counts[level], tree.sizes[level], tree.leaders[level]
    holders = np.empty(leaders.shape[1], dtype=np.int64)
    tree.bounds[level] += reduce_by_assignment(
        leaders, tree.candidates[level], sizes[:count], holders
    )
    room = limit - tree.bounds[level]
    if room <= 0.0:
        return False
    for c in range(holders.size):
        if holders[c] >= 0:
            tree.partners[tree.objects[level, holders[c]]] = c
    hopeless = False
    for k in range(count):
        for x in range(sizes[k]):
            hopeless = hopeless or leaders[k, x] >= room
    if hopeless:
        _drop(tree, level, room)
    return True


@kernel
def _drop(tree: Tree, level: int, room: float) -> None:
    """Drop the candidates whose leaders exceed what may still be lost, and close ranks."""
    count, sizes, starts = tree.counts[level], tree.sizes[level], tree.starts[level]
    leaders, candidates, blocks = tree.leaders[level], tree.candidates[level], tree.blocks
    end = starts[0, 1] if count > 1 else tree.ends[level]
    for k in range(count):
        for other in range(k + 1, count):
            place = starts[k, other]
            starts[k, other] = end
            for x in range(sizes[k]):
                for y in range(sizes[other]):
                    if leaders[k, x] < room and leaders[other, y] < room:
                        blocks[end] = blocks[place]
                        end += 1
                    place += 1
    tree.ends[level] = end
    for k in range(count):
        kept = 0
        for x in range(sizes[k]):
            if leaders[k, x] < room:
                leaders[k, kept], candidates[k, kept] = leaders[k, x], candidates[k, x]
                kept += 1
        sizes[k] = kept


@kernel
def fix(tree: Tree, level: int, k: int, x: int, more: float, limit: float) -> bool:
    """Make the node below in which the k-th open object has its x-th candidate.

    ``more`` is what any map within it loses beyond the sum of its terms.

    Returns
    -------
    bool
        False if there is no room for it. A node that is not open has ``limit`` as its bound.
    """
    below, count = level + 1, tree.counts[level] - 1
    candidates, leaders, sizes = tree.candidates, tree.leaders, tree.sizes
    starts, blocks = tree.starts, tree.blocks
    partner = candidates[level, k, x]
    bound = tree.bounds[level] + leaders[level, k, x] + more
    kept = np.empty((count, candidates.shape[2]), dtype=np.int64)
    tree.partners[tree.objects[level, k]] = partner
    tree.counts[below] = count
    tree.bounds[below] = limit
    if bound >= limit:
        return True
    for row in range(count):
        other = row + (row >= k)
        # The costs of the fixed candidate with those of other: a row of the block, or a column.
        place, step = starts[level, k, other] + x * sizes[level, other], 1
        if other < k:
            place, step = starts[level, other, k] + x, sizes[level, k]
        size = 0
        for y in range(sizes[level, other]):
            cost = blocks[place + y * step] + leaders[level, other, y]
            if bound + cost < limit and candidates[level, other, y] != partner:
                candidates[below, row, size] = candidates[level, other, y]
                leaders[below, row, size] = cost
                kept[row, size] = y
                size += 1
        if size == 0:
            return True
        tree.objects[below, row] = tree.objects[level, other]
        sizes[below, row] = size
    end = tree.ends[level]
    for row in range(count):
        for column in range(row + 1, count):
            a, b = row + (row >= k), column + (column >= k)
            starts[below, row, column] = end
            if end + sizes[below, row] * sizes[below, column] > blocks.size:
                return False
            for y in range(sizes[below, row]):
                start = starts[level, a, b] + kept[row, y] * sizes[level, b]
                for z in range(sizes[below, column]):
                    blocks[end] = blocks[start + kept[column, z]]
                    end += 1
    tree.bounds[below] = bound
    tree.ends[below] = end
    return True


@kernel
def sweep(tree: Tree, level: int, limit: float) -> None:
    """Give the leaders back to the blocks, and extract new ones."""
    room = limit - tree.bounds[level]
    count, sizes, leaders = tree.counts[level], tree.sizes[level], tree.leaders[level]
    given, low = np.empty(leaders.shape), np.empty(leaders.shape[1])
    for k in range(count):
        for x in range(sizes[k]):
            given[k, x] = leaders[k, x] / (count - 1.0)
            leaders[k, x] = 0.0
    for k in range(count):
        for other in range(k + 1, count):
            _extract(
                tree.blocks,
                tree.starts[level, k, other],
                given[k],
                given[other],
                sizes[k],
                sizes[other],
                leaders[k],
                leaders[other],
                low,
                count - 1.0,
                room,
            )


@kernel
def _extract(  # noqa: PLR0912
    blocks: FloatArray,
    start: int,
    given_rows: FloatArray,
    given_columns: FloatArray,
    height: int,
    width: int,
    rows: FloatArray,
    columns: FloatArray,
    low: FloatArray,
    others: float,
    room: float,
) -> None:
    """Add what is given to a block, and move its minima to the leaders of rows and columns.

    ``low`` is room for as many numbers as there are columns.
    """
    for y in range(width):
        low[y] = _NEVER
    for x in range(height):
        row = blocks[start + x * width : start + (x + 1) * width]
        least = _NEVER
        left = room - others * given_rows[x]
        for y in range(width):
            cost = row[y] + given_columns[y]
            if row[y] + others * given_columns[y] >= left:
                cost = FORBIDDEN
            row[y] = cost
            if cost < least:
                least = cost
        half = 0.5 * (least + given_rows[x])
        rows[x] += half
        shift = given_rows[x] - half
        for y in range(width):
            cost = row[y] + shift
            row[y] = cost
            if cost < low[y]:
                low[y] = cost
    for y in range(width):
        columns[y] += low[y]
    for x in range(height):
        row = blocks[start + x * width : start + (x + 1) * width]
        least = _NEVER
        for y in range(width):
            cost = row[y] - low[y]
            row[y] = cost
            if cost < least:
                least = cost
        if least > 0.0:
            rows[x] += least
            for y in range(width):
                row[y] -= least
