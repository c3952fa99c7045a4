"""Array types of the model, and how an array becomes part of a frozen value."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "BoolArray",
    "ComplexArray",
    "Float32Array",
    "FloatArray",
    "IntArray",
    "frozen",
    "frozen_floats",
    "real_floats",
    "sealed",
    "settled_middle",
]

_DType = TypeVar("_DType", bound=np.generic)

BoolArray = NDArray[np.bool_]
"""An array of truth values."""
ComplexArray = NDArray[np.complex128]
"""An array of complex128: points and vectors of the plane, x + iy."""
FloatArray = NDArray[np.float64]
"""An array of float64."""
Float32Array = NDArray[np.float32]
"""An array of float32: what is large and need not be precise."""
IntArray = NDArray[np.int64]
"""An array of int64."""


def frozen(array: NDArray[_DType]) -> NDArray[_DType]:
    """Return a contiguous array that cannot be written to, copied where it must be."""
    if array.flags.writeable or not array.flags.c_contiguous:
        array = array.copy(order="C")
        array.flags.writeable = False
    return array


def sealed(array: NDArray[_DType]) -> NDArray[_DType]:
    """Make an array read-only in place and return it; for its only owner, who saves a copy."""
    array.flags.writeable = False
    return array


def settled_middle(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return a point near the middle of bounds, which few changes of the bounds move.

    Its coordinates are multiples of the power of two that is as large as the bounds or less than
    twice as large.

    Parameters
    ----------
    low, high
        Shape (2,).

    Examples
    --------
    >>> settled_middle(np.array([1.0, 2.0]), np.array([8.0, 4.5]))
    array([8., 0.])
    >>> settled_middle(np.array([0.5, 2.0]), np.array([8.4, 4.9]))
    array([8., 0.])
    """
    step = 2.0 ** np.ceil(np.log2((high - low).max()))
    return np.asarray(step * np.round(0.5 * (low + high) / step), dtype=np.float64)


def frozen_floats(values: Any) -> FloatArray:
    """Return values as a read-only float64 array."""
    return frozen(np.asarray(values, dtype=np.float64))


def real_floats(values: Any) -> FloatArray:
    """Return values as a float64 array, none of which loses its imaginary part.

    Raises
    ------
    TypeError
        If they are complex, or no numbers.
    ValueError
        If they are no array, or no numbers.
    """
    array = np.asarray(values)
    if np.iscomplexobj(array):
        raise TypeError("the values are complex, not real")
    return np.asarray(array, dtype=np.float64)
