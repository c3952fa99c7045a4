"""Depth-first search through the quadratic assignment problems of cells."""

from __future__ import annotations

import numpy as np

from sketchmatch.api.kernels import kernel
from sketchmatch.model import FloatArray, IntArray
from sketchmatch_builtin.searchers._assignment import FORBIDDEN
from sketchmatch_builtin.searchers._cells import ROUNDING, Cells, cell_terms, tolerated
from sketchmatch_builtin.searchers._fixed import Fixed, enter_cell, fixed_loss
from sketchmatch_builtin.searchers._ranking import Ranking
from sketchmatch_builtin.searchers._relations import Relations, offer
from sketchmatch_builtin.searchers._residual import Tree, assign, fix, plant, sweep

__all__ = ["CELL", "NODES", "VISITED", "first_place", "search_cells"]

CELL, LEVEL, SWEEPS, NODES, VISITED = range(5)
"""Where a search is: the cell, the level in its tree (−1 before there is one), the sweeps left for
the node at that level (0 once it is branched on); the number of nodes so far, and of maps
evaluated."""

_ROOT_SWEEPS = 8
_NODE_SWEEPS = 2
_OVERHEAD = 600
_WORTHWHILE = 0.1
"""A sweep that raises the bound by less than this share of what is missing is the last one."""


def first_place(evaluations: int) -> IntArray:
    """Return where a search begins, shape (5,): at the first cell, before there is a tree."""
    place = np.zeros(5, dtype=np.int64)
    place[LEVEL], place[VISITED] = -1, evaluations
    return place


@kernel
def search_cells(  # noqa: PLR0912
    relations: Relations,
    found: Ranking,
    spread: float,
    cells: Cells,
    tree: Tree,
    fixed: Fixed,
    place: IntArray,
    given_up: FloatArray,
    budget: int,
    most_nodes: int,
) -> None:
    """Search cells one after the other, as far as a budget goes.

    Parameters
    ----------
    spread
        The greatest L̂ less the least.
    cells
        The cells, whose bounds are lowered in place.
    tree, fixed
        The present node and those above it: their problems, and what is fixed.
    place
        What :func:`first_place` returned, changed in place.
    given_up
        Shape (1,): the highest bound of what there was no memory for.
    budget
        Costs to touch in this call.
    most_nodes
        Nodes to stop at.
    """
    work, others = 0, cells.allowed.shape[2]
    while place[CELL] < cells.bounds.size and work < budget and place[NODES] < most_nodes:
        cell, level, limit = place[CELL], place[LEVEL], tolerated(found)
        leave = False
        if level < 0:  # a new cell
            leave = 1.0 - cells.bounds[cell] + ROUNDING >= limit
            if not leave:
                terms = cell_terms(relations, found.values[0], spread, cells.boxes[cell])
                leave = not plant(relations, tree, terms, cells.allowed[cell])
                if leave:
                    given_up[0] = max(given_up[0], cells.bounds[cell])
                tree.bounds[0] = terms.base
                enter_cell(fixed, terms)
                place[LEVEL], place[SWEEPS] = 0, _ROOT_SWEEPS
                place[NODES] += 1
                work += relations.cosine.size + tree.ends[0]
        elif place[SWEEPS] > 0:  # a node to tighten
            before = tree.bounds[level]
            if tree.counts[level] > 1:
                sweep(tree, level, limit)
                work += 2 * (tree.ends[level] - tree.starts[level, 0, 1])
            leave = not assign(tree, level, limit)
            work += _OVERHEAD + 4 * tree.counts[level] * others
            rise, missing = tree.bounds[level] - before, limit - tree.bounds[level]
            place[SWEEPS] = place[SWEEPS] - 1 if rise > _WORTHWHILE * missing else 0
            if level == 0:
                cells.bounds[cell] = min(cells.bounds[cell], 1.0 - tree.bounds[0] + ROUNDING)
            if place[SWEEPS] == 0 and not leave:
                offer(relations, found, tree.partners, found.values[0])
                place[VISITED] += 1
                tree.branches[level] = _fewest(tree, level)
        else:  # a node to branch on
            k = tree.branches[level]
            x = _cheapest(tree, level, k)
            leave = x < 0 or tree.bounds[level] + tree.leaders[level, k, x] >= limit
            if not leave:
                a, c = tree.objects[level, k], tree.candidates[level, k, x]
                more = fixed_loss(relations, fixed, level, a, c)
                place[NODES] += 1
                work += _OVERHEAD + tree.counts[level] * others
                if not fix(tree, level, k, x, more, limit):
                    given_up[0] = max(given_up[0], 1.0 - tree.bounds[level] + ROUNDING)
                elif tree.bounds[level + 1] < limit and assign(tree, level + 1, limit):
                    place[LEVEL], place[SWEEPS] = level + 1, _NODE_SWEEPS
                    work += tree.ends[level + 1] - tree.ends[level]
                tree.leaders[level, k, x] = FORBIDDEN  # tried
        if leave:
            place[LEVEL], place[SWEEPS] = max(level, 0) - 1, 0
            place[CELL] += place[LEVEL] < 0


@kernel
def _fewest(tree: Tree, level: int) -> int:
    """Return the open object with the fewest candidates."""
    best = 0
    for k in range(1, tree.counts[level]):
        if tree.sizes[level, k] < tree.sizes[level, best]:
            best = k
    return best


@kernel
def _cheapest(tree: Tree, level: int, k: int) -> int:
    """Return the candidate of an open object with the lowest leader, −1 if all are tried."""
    best, least = -1, 0.5 * FORBIDDEN
    if tree.counts[level] > 0:
        for x in range(tree.sizes[level, k]):
            if tree.leaders[level, k, x] < least:
                best, least = x, tree.leaders[level, k, x]
    return best
