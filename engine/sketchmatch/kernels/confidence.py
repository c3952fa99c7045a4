"""ζ, the confidence of a histogram map (thesis 3.6.1)."""

from __future__ import annotations

import numpy as np

from sketchmatch.kernels._jit import kernel
from sketchmatch.kernels.sorting import sort_values
from sketchmatch.model.arrays import FloatArray, IntArray

__all__ = ["fmap_confidence", "fmap_confidence_above", "mean_absolute_difference"]


@kernel
def fmap_confidence(
    entries: IntArray,
    scratch: FloatArray,
    evidence: FloatArray,
    cosine: FloatArray,
    sine: FloatArray,
    normalized_dilation: FloatArray,
    weights: FloatArray,
) -> tuple[float, float, float, float]:
    """Return ζ, ζσ, ζR and ζL of a histogram map.

    Parameters
    ----------
    entries
        int64, shape (Q,), each within [0, Q').
    scratch
        Shape (Q,), overwritten.
    evidence
        Shape (Q, Q'/2): σ of the relation table, a dual having that of its column; or shape
        (Q, Q'): the evidence of every entry, and ζσ is its mean.
    cosine, sine, normalized_dilation
        Shape (Q, Q'/2): cos R and sin R, times the rotation weight of each pair, and L̂, as the
        relation table has them; a dual, entry j ≥ Q'/2, has the cosine and the sine of column
        j − Q'/2 negated.
    weights
        Shape (3,), of ζσ, ζR and ζL.

    Returns
    -------
    tuple of float
        ζ = (w1 ζσ + w2 ζR + w3 ζL) / (w1 + w2 + w3) and its three parts.

    Examples
    --------
    Of two entries the second is a dual, so that its turn of 180° is one of 0° as the other is;
    their L̂ are 1 apart, which halves ζL.

    >>> entries, scratch = np.array([0, 1]), np.empty(2)
    >>> evidence, levels = np.array([[0.9], [0.7]]), np.array([[0.0], [1.0]])
    >>> cosine, sine, weights = np.array([[1.0], [-1.0]]), np.zeros((2, 1)), np.array([1.0, 1, 2])
    >>> np.array(fmap_confidence(entries, scratch, evidence, cosine, sine, levels, weights))
    array([0.7, 0.8, 1. , 0.5])
    """
    return fmap_confidence_above(
        -np.inf, entries, scratch, evidence, cosine, sine, normalized_dilation, weights
    )


@kernel
def fmap_confidence_above(
    floor: float,
    entries: IntArray,
    scratch: FloatArray,
    evidence: FloatArray,
    cosine: FloatArray,
    sine: FloatArray,
    normalized_dilation: FloatArray,
    weights: FloatArray,
) -> tuple[float, float, float, float]:
    """Return ζ and its parts as :func:`fmap_confidence`, unless ζ cannot be above ``floor``.

    ζL, which costs most, is at most 1. Where ζ would not be above ``floor`` even so, that upper
    bound of ζ is returned with ζL = 1.

    Parameters
    ----------
    floor
        What ζ is to exceed.
    entries, scratch, evidence, cosine, sine, normalized_dilation, weights
        As in :func:`fmap_confidence`; shapes (Q,), (Q,), (Q, Q'/2) or (Q, Q'), (Q, Q'/2) three
        times and (3,).

    Returns
    -------
    tuple of float
        ζ and its three parts, or a bound of ζ that is at most ``floor``, ζσ, ζR and 1.

    Examples
    --------
    Two entries whose L̂ are 1 apart: ζ is 0.7, and 0.95 if their dilations agreed.

    >>> evidence, cosine, sine = np.full((2, 1), 0.8), np.ones((2, 1)), np.zeros((2, 1))
    >>> levels, weights = np.array([[0.0], [1.0]]), np.array([1.0, 1.0, 2.0])
    >>> rest = np.array([0, 0]), np.empty(2), evidence, cosine, sine, levels, weights
    >>> [float(fmap_confidence_above(floor, *rest)[0]) for floor in (0.9, 0.95)]
    [0.7, 0.95]
    """
    count, half = entries.size, cosine.shape[1]
    folded = 2 * half - evidence.shape[1]
    similar = x = y = 0.0
    for i in range(count):
        own = column = entries[i]
        turned = 1.0
        if column >= half:
            own -= folded
            column -= half
            turned = -1.0
        similar += evidence[i, own]
        x += turned * cosine[i, column]
        y += turned * sine[i, column]
        scratch[i] = normalized_dilation[i, column]
    zeta_s = similar / count
    zeta_r = np.sqrt(x * x + y * y) / count
    # Shares first: a product of a part and a tiny weight would lose its digits.
    total_weight = weights[0] + weights[1] + weights[2]
    share_l = weights[2] / total_weight
    most = weights[0] / total_weight * zeta_s + weights[1] / total_weight * zeta_r + share_l
    if most <= floor:
        return most, zeta_s, zeta_r, 1.0
    zeta_l = np.exp2(-mean_absolute_difference(scratch))
    return most - share_l * (1.0 - zeta_l), zeta_s, zeta_r, zeta_l


@kernel
def mean_absolute_difference(values: FloatArray) -> float:
    """Return the mean of |x − y| over all pairs of values, which it sorts in place.

    Parameters
    ----------
    values
        Shape (k,), reordered.

    Returns
    -------
    float
        0 if there is only one value.

    Examples
    --------
    The gaps are 3, 1 and 2:

    >>> float(mean_absolute_difference(np.array([4.0, 1.0, 2.0])))
    2.0
    """
    count = values.size
    if count < 2:
        return 0.0
    sort_values(values)
    total = 0.0
    for k in range(count):
        total += (2 * k - count + 1) * values[k]
    return 2.0 * total / (count * (count - 1.0))
