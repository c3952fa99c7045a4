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

from sketchmatch.api.kernels import kernel, pair_index
from sketchmatch.model import FloatArray, IntArray
from sketchmatch_builtin.searchers._cells import (
    COSINE,
    HALF_COSINE,
    HALF_SINE,
    SINE,
    CellTerms,
)
from sketchmatch_builtin.searchers._relations import Relations

__all__ = ["Fixed", "empty_fixed", "enter_cell", "fixed_loss"]

X, Y, GREATEST = range(3)
"""What is summed over the entries between fixed objects."""


class Fixed(NamedTuple):
    """The fixed objects of the nodes from the root of a search tree to the present one.

    Attributes
    ----------
    objects, partners
        Shape (N,): the k-th object fixed, and its partner.
    sums
        Shape (N + 1, 3): X, Y and GREATEST over the entries of each level: Σ ω cos R, Σ ω sin R
        and Σ ω cosmax.
    losses
        Shape (N + 1,): the loss beyond the bound at each level.
    rate, turn
        Shapes (1,) and (4,): the rotation rate of this cell and its θ, as in
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
def enter_cell(fixed: Fixed, terms: CellTerms) -> None:
    """Count losses as a cell does; nothing is fixed in it yet."""
    fixed.rate[0] = terms.rotation_rate
    fixed.turn[:] = terms.turn


@kernel
def fixed_loss(relations: Relations, fixed: Fixed, level: int, a: int, c: int) -> float:
    """Fix a → c below a level, and return by how much the loss beyond the bound rises."""
    sums = fixed.sums
    x, y, greatest = sums[level, X], sums[level, Y], sums[level, GREATEST]
    fixed.objects[level], fixed.partners[level] = a, c
    for k in range(level):
        i, j, sign = _entry(relations, a, fixed.objects[k], c, fixed.partners[k])
        cosine, sine = sign * relations.cosine[i, j], sign * relations.sine[i, j]
        x, y = x + cosine, y + sine
        greatest += _greatest(cosine, sine, relations.rotation_weights[i], fixed.turn)
    below = level + 1
    sums[below, X], sums[below, Y], sums[below, GREATEST] = x, y, greatest
    most = _greatest(x, y, np.sqrt(x * x + y * y), fixed.turn)
    fixed.losses[below] = fixed.rate[0] * (greatest - most)
    return float(fixed.losses[below] - fixed.losses[level])


@kernel
def _greatest(x: float, y: float, length: float, turn: FloatArray) -> float:
    """Return the greatest component of a vector in a direction within the cell."""
    along = x * turn[COSINE] + y * turn[SINE]
    across = abs(y * turn[COSINE] - x * turn[SINE])
    if along >= turn[HALF_COSINE] * length:
        return length
    return float(along * turn[HALF_COSINE] + across * turn[HALF_SINE])


@kernel
def _entry(relations: Relations, a: int, b: int, c: int, d: int) -> tuple[int, int, float]:
    """Return row and column of an entry, and −1.0 if it is a dual, else 1.0."""
    if a > b:
        a, b, c, d = b, a, d, c
    objects = 1 + int(np.sqrt(2.0 * relations.pairs.shape[0]))
    i = pair_index(a, b, objects)
    j = relations.columns[c, d]
    half = relations.cosine.shape[1]
    if j >= half:
        return i, j - half, -1.0
    return i, j, 1.0
