"""Array types of the model, and how an array becomes part of a frozen value."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "BoolArray",
    "ComplexArray",
    "FloatArray",
    "IntArray",
    "frozen",
    "frozen_floats",
    "sealed",
]

_DType = TypeVar("_DType", bound=np.generic)

BoolArray = NDArray[np.bool_]
"""An array of truth values."""
ComplexArray = NDArray[np.complex128]
"""An array of complex128: points and vectors of the plane, x + iy."""
FloatArray = NDArray[np.float64]
"""An array of float64."""
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


def frozen_floats(values: Any) -> FloatArray:
    """Return values as a read-only float64 array."""
    return frozen(np.asarray(values, dtype=np.float64))
