"""The index of a pair of objects, for compiled callers."""

from __future__ import annotations

from sketchmatch.kernels._jit import kernel
from sketchmatch.model import relations

__all__ = ["pair_index"]

pair_index = kernel(relations.pair_index)
"""The same as :func:`sketchmatch.model.pair_index`, compiled; for one pair at a time."""
