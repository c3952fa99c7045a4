"""What the fixed part of a map loses in rotation, beyond its share of a cell's bound.

In the costs of a cell each entry has the θ of its own that suits it best. Those of the F entries
between fixed objects are known, and θ is the same for all of them, so any map within a node loses
more than its costs say, by at least

    w2/(W P) (Σ ω cosmax − max_θ Σ ω cos(R − θ)),

θ within the cell and both sums over F. The maximum is that of a vector sum, and the difference
does not fall as more objects are fixed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sketchmatch.api.kernels import kernel
from sketchmatch.model import FloatArray, IntArray
from sketchmatch_builtin.searchers._relations import Relations

__all__ = ["Fixed", "empty_fixed", "fixed_loss"]


class Fixed(NamedTuple):
    """The fixed objects of the nodes from the root of a search tree to the present one.

    Attributes
    ----------
    objects, partners
        Shape (N,): the k-th object fixed, and its partner.
    sums
        Shape (N + 1, 3): Σ ω cos R, Σ ω sin R and Σ ω cosmax over the entries of each level.
    losses
        Shape (N + 1,): the loss beyond the bound at each level.
    rate, turn
        Shapes (1,) and (4,): what an entry loses for ω (1 − cosmax) in this cell, and its θ, as in
        :class:`~sketchmatch_builtin.searchers._cells.CellTerms`.
    """

    objects: IntArray
    partners: IntArray
    sums: FloatArray
    losses: FloatArray
    rate: FloatArray
    turn: FloatArray


def empty_fixed(template_objects: int) -> Fixed:
    """Return what it is when nothing is fixed."""
    n, levels = template_objects, template_objects + 1
    return Fixed(
        objects=np.zeros(n, dtype=np.int64),
        partners=np.zeros(n, dtype=np.int64),
        sums=np.zeros((levels, 3)),
        losses=np.zeros(levels),
        rate=np.zeros(1),
        turn=np.zeros(4),
    )


@kernel
def fixed_loss(relations: Relations, fixed: Fixed, level: int, a: int, c: int) -> float:
    """Fix a → c below a level, and return by how much the loss beyond the bound rises."""
    x, y, greatest = fixed.sums[level]
    fixed.objects[level], fixed.partners[level] = a, c
    for k in range(level):
        i, j, sign = _entry(relations, a, fixed.objects[k], c, fixed.partners[k])
        cosine, sine = sign * relations.cosine[i, j], sign * relations.sine[i, j]
        x, y = x + cosine, y + sine
        greatest += _greatest(cosine, sine, relations.rotation_weights[i], fixed.turn)
    below = level + 1
    fixed.sums[below, 0], fixed.sums[below, 1], fixed.sums[below, 2] = x, y, greatest
    most = _greatest(x, y, np.sqrt(x * x + y * y), fixed.turn)
    fixed.losses[below] = fixed.rate[0] * (greatest - most)
    return float(fixed.losses[below] - fixed.losses[level])


@kernel
def _greatest(x: float, y: float, length: float, turn: FloatArray) -> float:
    """Return the greatest component of a vector in a direction within the cell."""
    along, across = x * turn[0] + y * turn[1], abs(y * turn[0] - x * turn[1])
    return length if along >= turn[2] * length else float(along * turn[2] + across * turn[3])


@kernel
def _entry(relations: Relations, a: int, b: int, c: int, d: int) -> tuple[int, int, float]:
    """Return row and column of an entry, and −1.0 if it is a dual, else 1.0."""
    if a > b:
        a, b, c, d = b, a, d, c
    objects = 1 + int(np.sqrt(2.0 * relations.pairs.shape[0]))
    i = a * objects - a * (a + 1) // 2 + b - a - 1
    j = relations.columns[c, d]
    half = relations.cosine.shape[1]
    if j >= half:
        return i, j - half, -1.0
    return i, j, 1.0
