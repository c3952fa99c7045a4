"""Compiled functions that a plugin written with numba may call from its own compiled code."""

from sketchmatch.kernels._jit import kernel
from sketchmatch.kernels.alignment import cosine_rows, rotated_rows
from sketchmatch.kernels.confidence import (
    fmap_confidence,
    fmap_confidence_above,
    mean_absolute_difference,
)
from sketchmatch.kernels.constant_force import constant_force_histograms
from sketchmatch.kernels.incremental import (
    MapState,
    confidence_after,
    empty_map_state,
    make_move,
    map_confidence,
    map_entry,
    place_map,
    total_distance,
)

__all__ = [
    "MapState",
    "confidence_after",
    "constant_force_histograms",
    "cosine_rows",
    "empty_map_state",
    "fmap_confidence",
    "fmap_confidence_above",
    "kernel",
    "make_move",
    "map_confidence",
    "map_entry",
    "mean_absolute_difference",
    "place_map",
    "rotated_rows",
    "total_distance",
]
