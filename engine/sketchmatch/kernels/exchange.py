"""ζ of all object maps that differ from one map by a single exchange."""

from __future__ import annotations

import numpy as np

from sketchmatch.kernels._jit import kernel
from sketchmatch.kernels.confidence import fmap_confidence
from sketchmatch.model.arrays import FloatArray, IntArray

__all__ = ["exchange_confidences"]


@kernel
def exchange_confidences(
    partners: IntArray,
    pairs: IntArray,
    columns: IntArray,
    relations: tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray],
) -> FloatArray:
    """Return ζ of the map in which one object takes another partner.

    Parameters
    ----------
    partners
        Shape (N,): an injective object map.
    pairs
        Shape (Q, 2): the template pairs.
    columns
        Shape (N', N'): the histogram correspondence of each ordered argument pair.
    relations
        The evidence, cos R, sin R, L̂ and the weights, as :func:`fmap_confidence` takes them.

    Returns
    -------
    ndarray
        Shape (N, N'): entry (g, h) is for g with partner h, whose holder, if there is one, takes
        what g had; −inf where g has h already.

    Examples
    --------
    Two objects on three, all that counts being σ of the one entry (0, 1) → (c, d):

    >>> from sketchmatch.model import correspondences
    >>> sigma = np.array([[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]])
    >>> rest = np.ones((1, 3)), np.zeros((1, 3)), np.zeros((1, 3)), np.array([1.0, 0.0, 0.0])
    >>> pairs = np.array([[0, 1]])
    >>> exchange_confidences(np.array([0, 1]), pairs, correspondences(3), (sigma, *rest))
    array([[-inf,  0.4,  0.6],
           [ 0.4, -inf,  0.2]])
    """
    objects = partners.size
    result = np.full((objects, columns.shape[0]), -np.inf)
    holder = np.full(columns.shape[0], -1)
    for g in range(objects):
        holder[partners[g]] = g
    changed = partners.copy()
    entries = np.empty(pairs.shape[0], dtype=np.int64)
    scratch = np.empty(pairs.shape[0])
    for g in range(objects):
        for h in range(columns.shape[0]):
            k = holder[h]
            if k == g:
                continue
            if 0 <= k < g:
                result[g, h] = result[k, partners[g]]
                continue
            changed[g] = h
            if k >= 0:
                changed[k] = partners[g]
            for i in range(entries.size):
                entries[i] = columns[changed[pairs[i, 0]], changed[pairs[i, 1]]]
            result[g, h] = fmap_confidence(entries, scratch, *relations)[0]
            changed[g] = partners[g]
            if k >= 0:
                changed[k] = h
    return result
