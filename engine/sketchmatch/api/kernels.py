"""Compiled functions that a plugin may call, from Python or from compiled code of its own.

- :func:`kernel` compiles a function as the engine's own are compiled: without the GIL, cached on
  disk, sums in the order in which they are written.
- ζ of any FMAP: :func:`fmap_confidence`, and :func:`fmap_confidence_above`, which gives up where ζ
  cannot exceed a floor.
- ζ of object maps move by move: :func:`empty_map_state` makes room for a :class:`MapState`,
  :func:`place_map` puts a map into it, :func:`confidence_after` weighs a move in O(N log N),
  :func:`make_move` makes it in O(Q), :func:`map_confidence` says ζ. Search by moves needs no more.
- Beneath these: :func:`map_entry` (evidence, cos R, sin R and L̂ of one entry) and
  :func:`map_evidence` (the first alone), :func:`total_distance` and
  :func:`mean_absolute_difference` (ζL).
- Rows of a relation table by objects: :func:`pair_index`.
- Rows of histograms: :func:`contrast_rows`, :func:`overlap_rows`.
- Sorting, for which numba's own takes long to compile: :func:`sort_values`.

Evidence is what an entry counts for beside rotation and dilation: σ, or more where a request weighs
the shapes and sizes of objects. A searcher that reads the table itself takes it, as these do, from
``RelationTable.entry_evidence``, and cos R and sin R from ``cosine`` and ``sine``, which are times
the rotation weight of each pair.

Generators of :mod:`numpy.random` may be handed to compiled code.

Examples
--------
>>> import numpy as np
>>> from sketchmatch.model import RelationTable
>>> similarity = np.array([[0.9, 0.2, 0.3], [0.1, 0.8, 0.2], [0.3, 0.1, 0.7]])
>>> table = RelationTable(similarity, np.zeros((3, 3)), np.ones((3, 3)), 3, 3)
>>> state = empty_map_state(table, (1.0, 0.0, 0.0))
>>> float(round(place_map(state, np.array([0, 1, 2])), 9))
0.8
>>> float(round(confidence_after(state, 0, 1), 9))  # objects 0 and 1 exchange their partners
0.4
>>> state.partners.tolist()
[0, 1, 2]
>>> bool(make_move(state, 0, 1) == map_confidence(state))
True
>>> state.partners.tolist()
[1, 0, 2]
"""

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
    map_evidence,
    place_map,
    total_distance,
)
from sketchmatch.kernels.pairs import pair_index
from sketchmatch.kernels.similarity import contrast_rows, overlap_rows
from sketchmatch.kernels.sorting import sort_values

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
    "map_evidence",
    "mean_absolute_difference",
    "overlap_rows",
    "pair_index",
    "place_map",
    "sort_values",
    "total_distance",
]
