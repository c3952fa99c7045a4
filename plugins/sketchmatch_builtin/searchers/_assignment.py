"""The linear assignment problem, compiled: shortest augmenting paths over lists of candidates.

Reference: R. Jonker and A. Volgenant, "A shortest augmenting path algorithm for dense and sparse
linear assignment problems", Computing 38, 1987.
"""

from __future__ import annotations

import numpy as np

from sketchmatch.api.kernels import kernel
from sketchmatch.model import FloatArray, IntArray

__all__ = ["FORBIDDEN", "reduce_by_assignment"]

FORBIDDEN = 1e3
"""Cost of what must not be; the costs of whole maps stay far below."""


@kernel
def reduce_by_assignment(  # noqa: PLR0912
    costs: FloatArray, candidates: IntArray, sizes: IntArray, holders: IntArray
) -> float:
    """Find the cheapest assignment and put its reduced costs in the place of the costs.

    Row k may take the columns ``candidates[k, :sizes[k]]`` at ``costs[k, :sizes[k]]``, each
    column at most once. Any assignment costs the returned value, or more, beyond the sum of its
    reduced costs c − u − v ≥ 0: the dual v of a column is 0 where it is left over, else v ≤ 0.

    Parameters
    ----------
    costs, candidates
        Shape (rows, any).
    sizes
        Shape (rows,).
    holders
        Shape (columns,), overwritten: the row that takes each column, −1 for none.

    Returns
    -------
    float
        The cost of the cheapest assignment; FORBIDDEN if there is none.
    """
    rows, columns = sizes.size, holders.size
    u, v, distance = np.empty(rows), np.empty(columns), np.empty(columns)
    settled = np.empty(columns, dtype=np.bool_)
    before = np.empty(columns, dtype=np.int64)
    taken = np.empty(rows, dtype=np.int64)
    for j in range(columns):
        v[j], holders[j] = 0.0, -1
    for k in range(rows):  # each takes its cheapest column where that is free
        best, u[k], taken[k] = -1, FORBIDDEN, -1
        for x in range(sizes[k]):
            if costs[k, x] < u[k]:
                best, u[k] = candidates[k, x], costs[k, x]
        if best >= 0 and holders[best] < 0:
            holders[best], taken[k] = k, best
    total = 0.0
    for first in range(rows):
        if taken[first] >= 0:
            continue
        # Dijkstra: the free column that is nearest by alternating paths.
        for j in range(columns):
            distance[j], settled[j] = 0.5 * FORBIDDEN, False
        row, end, length = first, -1, 0.0
        while end < 0:
            for x in range(sizes[row]):
                j = candidates[row, x]
                step = max(length, length + costs[row, x] - u[row] - v[j])
                if not settled[j] and step < distance[j]:
                    distance[j], before[j] = step, row
            nearest, length = -1, 0.5 * FORBIDDEN
            for j in range(columns):
                if not settled[j] and distance[j] < length:
                    nearest, length = j, distance[j]
            if nearest < 0:
                return FORBIDDEN
            if holders[nearest] < 0:
                end = nearest
            else:
                settled[nearest] = True
                row = holders[nearest]
        u[first] += length
        for j in range(columns):
            if settled[j]:
                u[holders[j]] += length - distance[j]
                v[j] -= length - distance[j]
                total -= length - distance[j]
        while end >= 0:
            row = before[end]
            holders[end] = row
            end, taken[row] = taken[row], end
    for k in range(rows):
        total += u[k]
        for x in range(sizes[k]):
            costs[k, x] = max(0.0, costs[k, x] - u[k] - v[candidates[k, x]])
    return total
