"""What speaks for an entry beside σ: how alike its objects are in shape and in size.

An object's own histogram F^aa, of constant forces within it, carries its shape, its size and how it
is turned. An entry (a, b) → (c, d) says that a is c and b is d, turned by R and L̂ times as large.

- Its shape, s = ½(ς_ac(R) + ς_bd(R)): ς_ac(R) is the normalised cross-correlation of F^aa turned by
  R with F^cc.
- Its size, m = ½(2^−|l_ac − L̂| + 2^−|l_bd − L̂|): l_ac is the normalised dilation from F^aa to F^cc.

F^aa repeats after half a turn, so R and R + π are the same to it, and half of its bins are all.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sketchmatch.kernels._jit import kernel
from sketchmatch.model.arrays import FloatArray, IntArray
from sketchmatch.model.relations import DILATION_SCALE

__all__ = ["SelfRelations", "mean_parts", "weigh_entries"]


class SelfRelations(NamedTuple):
    """How every template object's own histogram h compares with every argument object's h'.

    Attributes
    ----------
    products
        Shape (N, N', n/2): Σ h[m − k] h'[m] for turns by k bins, both in units of their norm.
    roughness
        Shape (N,): ½ Σ (h[m] − h[m − 1])², h in units of its norm.
    levels
        Shape (N, N'): l, the normalised dilations from h to h'.
    """

    products: FloatArray
    roughness: FloatArray
    levels: FloatArray


@kernel
def weigh_entries(
    first: int,
    last: int,
    pairs: tuple[IntArray, IntArray],
    relations: tuple[FloatArray, FloatArray, FloatArray],
    own: SelfRelations,
    weights: FloatArray,
    evidence: FloatArray,
) -> None:
    """Write the evidence of all entries of some template pairs.

    Parameters
    ----------
    first, last
        The template pairs are ``first`` to ``last`` − 1.
    pairs
        Shapes (Q, 2) and (Q'/2, 2): those of the template and of the argument.
    relations
        Shape (Q, Q'/2): σ, R and L.
    weights
        Shape (3,), of σ, shape and size; their sum is 1.
    evidence
        Shape (Q, Q'), written: the weighted mean of the three, of an entry and of its dual.

    Examples
    --------
    Two objects on two, of which the first is like the first alone and the second like the second
    alone, of the same sizes. σ is 0.6; the entry is wholly alike in shape, and its dual not at all.

    >>> own = SelfRelations(np.eye(2)[:, :, None] * np.ones(2), np.zeros(2), np.zeros((2, 2)))
    >>> pairs, evidence = (np.array([[0, 1]]), np.array([[0, 1]])), np.empty((1, 2))
    >>> relations = np.array([[0.6]]), np.array([[0.0]]), np.array([[1.0]])
    >>> weigh_entries(0, 1, pairs, relations, own, np.array([0.5, 0.25, 0.25]), evidence)
    >>> evidence
    array([[0.8 , 0.55]])
    """
    template, argument = pairs
    similarity, rotation, dilation = relations
    half = argument.shape[0]
    for i in range(first, last):
        a, b = template[i, 0], template[i, 1]
        for j in range(half):
            c, d = argument[j, 0], argument[j, 1]
            turn, level = rotation[i, j], DILATION_SCALE * np.log(dilation[i, j])
            alike = weights[0] * similarity[i, j]
            shape, size = _parts(own, a, b, c, d, turn, level)
            evidence[i, j] = alike + weights[1] * shape + weights[2] * size
            shape, size = _parts(own, a, b, d, c, turn, level)
            evidence[i, half + j] = alike + weights[1] * shape + weights[2] * size


@kernel
def mean_parts(
    entries: IntArray,
    pairs: tuple[IntArray, IntArray],
    rotation: FloatArray,
    dilation: FloatArray,
    own: SelfRelations,
) -> tuple[float, float]:
    """Return ζS and ζM of an FMAP: the means of shape and size over its entries.

    Parameters
    ----------
    entries
        int64, shape (Q,), each within [0, Q').
    pairs
        Shapes (Q, 2) and (Q'/2, 2): those of the template and of the argument.
    rotation, dilation
        Shape (Q, Q'/2): R and L.
    own
        How every template object compares with every argument object.

    Examples
    --------
    The dual of the only pair of two on two: no object is shaped like its partner, and each is
    of its size, but the relation is twice as large, for which L̂ = 1.5.

    >>> own = SelfRelations(np.eye(2)[:, :, None] * np.ones(2), np.zeros(2), np.zeros((2, 2)))
    >>> pairs, rotation = (np.array([[0, 1]]), np.array([[0, 1]])), np.array([[0.0]])
    >>> shape, size = mean_parts(np.array([1]), pairs, rotation, np.array([[2.0]]), own)
    >>> float(shape), round(float(size), 6)
    (0.0, 0.353553)
    """
    template, argument = pairs
    shapes = sizes = 0.0
    for i in range(entries.size):
        j, dual = entries[i] % argument.shape[0], entries[i] >= argument.shape[0]
        c, d = argument[j, 1 if dual else 0], argument[j, 0 if dual else 1]
        level = DILATION_SCALE * np.log(dilation[i, j])
        shape, size = _parts(own, template[i, 0], template[i, 1], c, d, rotation[i, j], level)
        shapes += shape
        sizes += size
    return shapes / entries.size, sizes / entries.size


@kernel
def _parts(
    own: SelfRelations, a: int, b: int, c: int, d: int, turn: float, level: float
) -> tuple[float, float]:
    """Return shape and size of the entry (a, b) → (c, d)."""
    bins = own.products.shape[2]
    place = turn * bins / np.pi
    whole = int(np.floor(place))
    rest = place - whole
    whole %= bins
    shape = _alike(own, a, c, whole, rest) + _alike(own, b, d, whole, rest)
    size = np.exp2(-abs(own.levels[a, c] - level)) + np.exp2(-abs(own.levels[b, d] - level))
    return 0.5 * shape, 0.5 * size


@kernel
def _alike(own: SelfRelations, a: int, c: int, whole: int, rest: float) -> float:
    """Return ς_ac of a turn by whole bins and a rest, between which h is read linearly."""
    products = own.products[a, c]
    after = whole + 1 if whole + 1 < products.size else 0
    product = (1.0 - rest) * products[whole] + rest * products[after]
    square = 1.0 - 2.0 * rest * (1.0 - rest) * own.roughness[a]
    return min(1.0, float(product / np.sqrt(square)))
