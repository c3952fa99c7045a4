"""The relation table as kernels read it, and ζ of object maps for branch and bound."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from sketchmatch.api.kernels import fmap_confidence_above, kernel
from sketchmatch.model import DILATION_SCALE, FloatArray, IntArray, RelationTable
from sketchmatch_builtin.searchers._ranking import Ranking, insert

__all__ = ["Relations", "offer", "read_slices"]

_VALUES = 200_000
"""Values of the relation table to read at a time, in about 10 ms."""


class Relations(NamedTuple):
    """The problem as the kernels read it.

    Attributes
    ----------
    pairs
        Shape (Q, 2), the template pairs.
    columns
        Shape (N', N'), the histogram correspondence of each ordered argument pair.
    evidence
        Shape (Q, Q'/2) or (Q, Q'): σ, or the evidence of every entry.
    cosine, sine, dilation
        Shape (Q, Q'/2): cos R and sin R, times the rotation weight of each pair, and L̂.
    rotation_weights
        Shape (Q,): what R of each template pair counts for in ζR, 1 on average.
    shares
        Shape (3,): the weights of ζσ, ζR and ζL divided by their sum.
    """

    pairs: IntArray
    columns: IntArray
    evidence: FloatArray
    cosine: FloatArray
    sine: FloatArray
    dilation: FloatArray
    rotation_weights: FloatArray
    shares: FloatArray


def read_slices(
    table: RelationTable, cosine: FloatArray, sine: FloatArray, dilation: FloatArray
) -> Iterator[slice]:
    """Write cos R and sin R, weighted, and L̂ of a relation table into arrays of its shape.

    Yields
    ------
    slice
        The rows that were written just now.
    """
    step = max(1, _VALUES // table.argument_pairs)
    for first in range(0, table.template_pairs, step):
        rows = slice(first, first + step)
        for function, part in ((np.cos, cosine), (np.sin, sine)):
            function(table.rotation[rows], out=part[rows])
            part[rows] *= table.rotation_weights[rows, None]
        np.multiply(np.log(table.dilation[rows]), DILATION_SCALE, out=dilation[rows])
        yield rows


@kernel
def offer(relations: Relations, found: Ranking, partners: IntArray, floor: float) -> float:
    """Evaluate an object map and keep it if it is among the best.

    Returns
    -------
    float
        Its ζ; anything not above ``floor``, if ζ is above neither that nor the worst kept.
    """
    pairs, columns = relations.pairs, relations.columns
    entries = np.empty(pairs.shape[0], dtype=np.int64)
    for i in range(entries.size):
        entries[i] = columns[partners[pairs[i, 0]], partners[pairs[i, 1]]]
    value = fmap_confidence_above(
        min(floor, found.values[-1]),
        entries,
        np.empty(entries.size),
        relations.evidence,
        relations.cosine,
        relations.sine,
        relations.dilation,
        relations.shares,
    )[0]
    insert(found, partners, value)
    return float(value)
