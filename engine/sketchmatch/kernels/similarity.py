"""Measures that compare histograms bin by bin."""

from __future__ import annotations

import numpy as np

from sketchmatch.kernels._jit import kernel
from sketchmatch.model.arrays import FloatArray

__all__ = ["contrast_rows", "overlap_rows"]

_NOTHING = 1e-9


@kernel
def contrast_rows(
    first: FloatArray, second: FloatArray, first_weight: float, second_weight: float
) -> FloatArray:
    """Return Tversky's ratio c / (c + αa + βb) for each row x of ``first`` and y of ``second``.

    It weighs what two fuzzy sets have in common, c = Σ min(x, y), against what only one has,
    a = Σ max(x − y, 0) and b = Σ max(y − x, 0). Where there is nothing to weigh it is 0.

    Parameters
    ----------
    first, second
        Shape (k, n), not negative.
    first_weight, second_weight
        α and β, not negative.

    Returns
    -------
    ndarray
        Shape (k,), within [0, 1].

    Examples
    --------
    Both have 2, the first has 1 alone and the second 3: 2 / (2 + 1 + 0.5·3).

    >>> first, second = np.array([[3.0, 0.0]]), np.array([[2.0, 3.0]])
    >>> contrast_rows(first, second, 1.0, 0.5).round(6)
    array([0.444444])
    """
    result = np.empty(first.shape[0])
    for k in range(first.shape[0]):
        common = _sum_of_minima(first[k], second[k])
        first_alone = max(_sum(first[k]) - common, 0.0)
        second_alone = max(_sum(second[k]) - common, 0.0)
        apart = first_weight * first_alone + second_weight * second_alone
        result[k] = common / (common + apart) if common > 0.0 else 0.0
    return result


@kernel
def _sum_of_minima(x: FloatArray, y: FloatArray) -> float:
    """Return Σ min(x, y), in four sums that a processor adds at once."""
    a = b = c = d = 0.0
    whole = x.size - x.size % 4
    for m in range(0, whole, 4):
        a += min(x[m], y[m])
        b += min(x[m + 1], y[m + 1])
        c += min(x[m + 2], y[m + 2])
        d += min(x[m + 3], y[m + 3])
    for m in range(whole, x.size):
        a += min(x[m], y[m])
    return (a + b) + (c + d)


@kernel
def _sum(x: FloatArray) -> float:
    """Return Σ x, likewise."""
    a = b = c = d = 0.0
    whole = x.size - x.size % 4
    for m in range(0, whole, 4):
        a += x[m]
        b += x[m + 1]
        c += x[m + 2]
        d += x[m + 3]
    for m in range(whole, x.size):
        a += x[m]
    return (a + b) + (c + d)


@kernel
def overlap_rows(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the mean of min/max over the bins that are not empty in both rows.

    A bin is empty where both hold less than 1e-9 of the largest value in the two rows.

    Parameters
    ----------
    first, second
        Shape (k, n), not negative, no row all zero.

    Returns
    -------
    ndarray
        Shape (k,), within [0, 1].

    Examples
    --------
    Of four bins one is empty in both, so it is the mean of 1/2, 1 and 0:

    >>> overlap_rows(np.array([[1.0, 3.0, 0.0, 0.0]]), np.array([[2.0, 3.0, 0.0, 5.0]]))
    array([0.5])
    """
    result = np.empty(first.shape[0])
    for k in range(first.shape[0]):
        largest = 0.0
        for m in range(first.shape[1]):
            largest = max(largest, first[k, m], second[k, m])
        total, bins = 0.0, 0
        for m in range(first.shape[1]):
            low, high = min(first[k, m], second[k, m]), max(first[k, m], second[k, m])
            if high > _NOTHING * largest:
                total += low / high
                bins += 1
        result[k] = total / bins if bins > 0 else 0.0
    return result
