"""Compiled functions that a plugin written with numba may call from its own compiled code."""

from sketchmatch.kernels._jit import kernel
from sketchmatch.kernels.alignment import cosine_rows, rotated_rows
from sketchmatch.kernels.confidence import (
    fmap_confidence,
    fmap_confidence_above,
    mean_absolute_difference,
)
from sketchmatch.kernels.constant_force import constant_force_histograms

__all__ = [
    "constant_force_histograms",
    "cosine_rows",
    "fmap_confidence",
    "fmap_confidence_above",
    "kernel",
    "mean_absolute_difference",
    "rotated_rows",
]
