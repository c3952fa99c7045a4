"""Compiled functions that a plugin written with numba may call from its own compiled code."""

from sketchmatch.kernels._jit import kernel
from sketchmatch.kernels.confidence import (
    fmap_confidence,
    fmap_confidence_above,
    mean_absolute_difference,
)
from sketchmatch.kernels.constant_force import constant_force_histograms
from sketchmatch.kernels.hybrid_force import hybrid_force_histograms
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
from sketchmatch.kernels.power_force import power_force_histograms
from sketchmatch.kernels.similarity import contrast_rows, overlap_rows

__all__ = [
    "MapState",
    "confidence_after",
    "constant_force_histograms",
    "contrast_rows",
    "empty_map_state",
    "fmap_confidence",
    "fmap_confidence_above",
    "hybrid_force_histograms",
    "kernel",
    "make_move",
    "map_confidence",
    "map_entry",
    "mean_absolute_difference",
    "overlap_rows",
    "place_map",
    "power_force_histograms",
    "total_distance",
]
