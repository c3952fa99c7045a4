"""Compiled functions that a plugin written with numba may call from its own compiled code."""

from sketchmatch.kernels._jit import kernel
from sketchmatch.kernels.confidence import (
    fmap_confidence,
    fmap_confidence_above,
    mean_absolute_difference,
)
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
from sketchmatch.kernels.similarity import contrast_rows, overlap_rows

__all__ = [
    "MapState",
    "confidence_after",
    "contrast_rows",
    "empty_map_state",
    "fmap_confidence",
    "fmap_confidence_above",
    "kernel",
    "make_move",
    "map_confidence",
    "map_entry",
    "mean_absolute_difference",
    "overlap_rows",
    "place_map",
    "total_distance",
]
