"""Sorting, which numba's own takes a second to compile for."""

from __future__ import annotations

import numpy as np

from sketchmatch.kernels._jit import kernel
from sketchmatch.model.arrays import FloatArray

__all__ = ["sort_values"]

_FEW = 64
_DEEPEST = 64


@kernel
def sort_values(values: FloatArray) -> None:
    """Sort values in place: by quicksort down to a few, and these by insertion.

    Parameters
    ----------
    values
        Shape (k,), reordered.

    Examples
    --------
    >>> values = np.array([4.0, 1.0, 2.0])
    >>> sort_values(values)
    >>> values
    array([1., 2., 4.])
    """
    if values.size > _FEW:
        waiting = np.empty((_DEEPEST, 2), dtype=np.int64)
        waiting[0, 0], waiting[0, 1] = 0, values.size
        depth = 1
        while depth > 0:
            depth -= 1
            low, high = waiting[depth, 0], waiting[depth, 1]
            while high - low > _FEW:
                a, b, c = values[low], values[(low + high) // 2], values[high - 1]
                pivot = max(min(a, b), min(max(a, b), c))
                i, j = low, high - 1
                while i <= j:
                    while values[i] < pivot:
                        i += 1
                    while pivot < values[j]:
                        j -= 1
                    if i <= j:
                        values[i], values[j] = values[j], values[i]
                        i += 1
                        j -= 1
                if j + 1 - low < high - i:  # the longer part waits: never more than log2 k do
                    waiting[depth, 0], waiting[depth, 1] = i, high
                    high = j + 1
                else:
                    waiting[depth, 0], waiting[depth, 1] = low, j + 1
                    low = i
                depth += 1
    for k in range(1, values.size):
        value = values[k]
        place = k
        while place > 0 and values[place - 1] > value:
            values[place] = values[place - 1]
            place -= 1
        values[place] = value
