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
    """
    result = np.empty(first.shape[0])
    for k in range(first.shape[0]):
        common = first_alone = second_alone = 0.0
        for m in range(first.shape[1]):
            x, y = first[k, m], second[k, m]
            common += min(x, y)
            first_alone += max(x - y, 0.0)
            second_alone += max(y - x, 0.0)
        apart = first_weight * first_alone + second_weight * second_alone
        result[k] = common / (common + apart) if common > 0.0 else 0.0
    return result


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
