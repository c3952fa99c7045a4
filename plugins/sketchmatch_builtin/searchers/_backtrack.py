"""Depth-first search with bounds from the fixed objects alone, the fastest where maps are few.

With f of P entries fixed and g = P − f left, for any map that completes them

- Σe, of the evidence, is at most Σe over the fixed entries, and for each other pair the greatest
  e of its row,
- |Σ ω e^{iR}| at most the length of that sum over the fixed entries, and Σω over the others,
- Σ|x − y| over all pairs of L̂ at least that sum over the fixed entries, and g times the sum of
  their distances to their median: nothing is nearer to all of them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sketchmatch.api.kernels import kernel
from sketchmatch.model import FloatArray, IntArray
from sketchmatch_builtin.searchers._cells import ROUNDING, TOLERANCE
from sketchmatch_builtin.searchers._ranking import Ranking
from sketchmatch_builtin.searchers._relations import Relations, offer

__all__ = ["DEPTH", "EVIDENCE", "LEAVES", "STEPS", "Path", "backtrack", "first_path"]

DEPTH, STEPS, LEAVES = range(3)
"""Where a search is: how many objects are fixed, −1 at the end; steps, and maps evaluated."""

EVIDENCE, COSINE, SINE, DILATION = range(4)
"""What is known at each depth of the fixed entries: three sums, and a bound of ζL."""

OMEGA = 1
"""Beside EVIDENCE, what is summed over all other pairs."""


class Path(NamedTuple):
    """The objects fixed so far, and what follows from them at each depth.

    Attributes
    ----------
    order
        Shape (N,): the template objects in the order in which they are fixed.
    evidence, cosine, sine, dilation
        Shape (Q, Q'/2), the evidence also (Q, Q'): the relations, the pairs of the second object
        with the first in front, then those of the third with the first and the second, and so on.
    partners
        Shape (N,): in that order; at the present depth the last that was tried, −1 for none.
    used
        Shape (N',): which partners are taken.
    sums
        Shape (N + 1, 4): EVIDENCE, COSINE and SINE, which are Σe, Σ ω cos R and Σ ω sin R over the
        fixed entries, and DILATION, a bound of ζL.
    levels
        Shape (N + 1, P): their L̂ in order.
    rest
        Shape (2, N + 1): EVIDENCE and OMEGA, the sums of the greatest e, and of ω, of all other
        pairs.
    place
        Shape (3,): DEPTH, STEPS and LEAVES.
    """

    order: IntArray
    evidence: FloatArray
    cosine: FloatArray
    sine: FloatArray
    dilation: FloatArray
    partners: IntArray
    used: NDArray[np.bool_]
    sums: FloatArray
    levels: FloatArray
    rest: FloatArray
    place: IntArray


def first_path(relations: Relations, argument_objects: int, evaluations: int) -> Path:
    """Return the path on which nothing is fixed.

    The order begins with the objects whose distances, and so their L̂ on average over all
    partners, are unusual: a wrong partner shows soonest there.
    """
    low, high = relations.pairs.T
    objects = int(high[-1]) + 1
    row = np.zeros((objects, objects), dtype=np.int64)
    row[low, high] = row[high, low] = np.arange(len(low))
    mean = relations.dilation.mean(axis=1)
    unusual = np.abs(mean - mean.mean())[row]
    np.fill_diagonal(unusual, 0.0)
    order = np.zeros(objects, dtype=np.int64)
    order[0] = unusual.max(axis=1).argmax()
    with_fixed = np.zeros(objects)
    for depth in range(1, objects):
        with_fixed += unusual[order[depth - 1]]
        with_fixed[order[depth - 1]] = -np.inf
        order[depth] = with_fixed.argmax()
    later, earlier = np.tril_indices(objects, k=-1)
    rows = row[order[later], order[earlier]]
    # An entry's dual has the opposite direction.
    turned = np.where(order[later] > order[earlier], 1.0, -1.0)[:, None]
    evidence, half = relations.evidence[rows], relations.cosine.shape[1]
    if evidence.shape[1] > half:
        evidence = np.where(turned > 0.0, evidence, np.roll(evidence, half, axis=1))
    most = (evidence.max(axis=1), relations.rotation_weights[rows])
    rest = np.array([np.bincount(later, values, objects + 1) for values in most])
    sums = np.zeros((objects + 1, 4))
    sums[:, DILATION] = 1.0
    place = np.zeros(3, dtype=np.int64)
    place[LEAVES] = evaluations
    return Path(
        order=order,
        evidence=evidence,
        cosine=relations.cosine[rows] * turned,
        sine=relations.sine[rows] * turned,
        dilation=relations.dilation[rows],
        partners=np.full(objects, -1, dtype=np.int64),
        used=np.zeros(argument_objects, dtype=np.bool_),
        sums=sums,
        levels=np.zeros((objects + 1, len(low))),
        rest=rest[:, ::-1].cumsum(axis=1)[:, ::-1].copy(),
        place=place,
    )


@kernel
def backtrack(  # noqa: PLR0912, PLR0915
    relations: Relations, found: Ranking, path: Path, budget: int
) -> None:
    """Go on through all maps that may be among the best, for so many steps.

    Parameters
    ----------
    found
        The best maps, which are replaced by better ones: in the end none that is left out is
        better than the last of them.
    """
    # All arrays are taken out of their tuples first: in the loop that would take half of the time.
    evidence, cosine, sine, dilation = path.evidence, path.cosine, path.sine, path.dilation
    columns = relations.columns
    w_s, w_r, w_l = relations.shares
    order, partners, used = path.order, path.partners, path.used
    sums, levels, rest, place = path.sums, path.levels, path.rest, path.place
    objects, others = partners.size, used.size
    whole = np.empty(objects, dtype=np.int64)
    pairs, half = cosine.shape
    folded = 2 * half - evidence.shape[1]
    scale = 2.0 / max(1.0, pairs * (pairs - 1.0))
    depth, steps = place[DEPTH], 0
    needed = found.values[-1] + TOLERANCE - ROUNDING
    while depth >= 0 and steps < budget:
        c = partners[depth]
        if c >= 0:
            used[c] = False
        c += 1
        while c < others and used[c]:
            c += 1
        if c == others:
            partners[depth] = -1
            depth -= 1
            continue
        partners[depth] = c
        steps += 1
        below, old = depth + 1, depth * (depth - 1) // 2
        count = old + depth
        left = pairs - count
        similar, x, y = sums[depth, EVIDENCE], sums[depth, COSINE], sums[depth, SINE]
        for k in range(depth):
            own = j = columns[partners[k], c]
            sign = 1.0
            if j >= half:
                own -= folded
                j -= half
                sign = -1.0
            similar += evidence[old + k, own]
            x += sign * cosine[old + k, j]
            y += sign * sine[old + k, j]
        most = w_s * (similar + rest[EVIDENCE, below])
        most += w_r * (np.sqrt(x * x + y * y) + rest[OMEGA, below])
        least = needed - most / pairs
        if sums[depth, DILATION] * w_l <= least:
            continue
        for k in range(old):
            levels[below, k] = levels[depth, k]
        for k in range(depth):
            j = columns[partners[k], c]
            level = dilation[old + k, j if j < half else j - half]
            p = old + k
            while p > 0 and levels[below, p - 1] > level:
                levels[below, p] = levels[below, p - 1]
                p -= 1
            levels[below, p] = level
        # From outside in: the k-th least and greatest are apart from so many more than inner ones,
        # and from what is left.
        spread = 0.0
        for k in range(count // 2):
            weight = count - 1.0 - 2.0 * k + left
            spread += weight * (levels[below, count - 1 - k] - levels[below, k])
        sums[below, EVIDENCE], sums[below, COSINE], sums[below, SINE] = similar, x, y
        sums[below, DILATION] = np.exp2(-scale * spread)
        if sums[below, DILATION] * w_l <= least:
            continue
        used[c] = True
        if below < objects:
            depth = below
        else:
            for k in range(objects):
                whole[order[k]] = partners[k]
            offer(relations, found, whole, found.values[-1])
            needed = found.values[-1] + TOLERANCE - ROUNDING
            place[LEAVES] += 1
    place[DEPTH] = depth
    place[STEPS] += steps
