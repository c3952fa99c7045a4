"""ζ of all object maps that differ from one map by a single exchange, or by one object left out."""

from __future__ import annotations

import numpy as np

from sketchmatch.kernels._jit import kernel, read_only
from sketchmatch.kernels.confidence import fmap_confidence
from sketchmatch.model.arrays import FloatArray, IntArray

__all__ = ["exchange_confidences", "omission_confidences"]


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
            result[g, h] = fmap_confidence(read_only(entries), scratch, *relations)[0]
            changed[g] = partners[g]
            if k >= 0:
                changed[k] = h
    return result


@kernel
def omission_confidences(
    entries: IntArray,
    pairs: IntArray,
    rotation_weights: FloatArray,
    relations: tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray],
) -> FloatArray:
    """Return ζ of a histogram map without each of its objects in turn.

    Parameters
    ----------
    entries
        Shape (Q,): the histogram map of N ≥ 3 objects.
    pairs
        Shape (Q, 2): the template pairs.
    rotation_weights
        Shape (Q,): what the rotation of each template pair counts for; that of the pairs that are
        left counts in proportion to it.
    relations
        The evidence, cos R, sin R, L̂ and the weights, as :func:`fmap_confidence` takes them.

    Returns
    -------
    ndarray
        Shape (N,): entry g is for the pairs that g is no part of.

    Examples
    --------
    Three objects, all that counts being σ: without the first, (1, 2) is left.

    >>> sigma = np.array([[0.1], [0.2], [0.3]])
    >>> rest = np.ones((3, 1)), np.zeros((3, 1)), np.zeros((3, 1)), np.array([1.0, 0.0, 0.0])
    >>> pairs = np.array([[0, 1], [0, 2], [1, 2]])
    >>> omission_confidences(np.zeros(3, dtype=np.int64), pairs, np.ones(3), (sigma, *rest))
    array([0.3, 0.2, 0.1])
    """
    evidence, cosine, sine, normalized_dilation, weights = relations
    half = cosine.shape[1]
    folded = 2 * half - evidence.shape[1]
    objects = pairs[-1, 1] + 1
    count = (objects - 1) * (objects - 2) // 2
    result = np.empty(objects)
    first = np.zeros(count, dtype=np.int64)
    scratch = np.empty(count)
    similar, x, y = np.empty((count, 1)), np.empty((count, 1)), np.empty((count, 1))
    levels = np.empty((count, 1))
    for g in range(objects):
        k = 0
        total = 0.0
        for i in range(entries.size):
            if pairs[i, 0] == g or pairs[i, 1] == g:
                continue
            entry = column = entries[i]
            turned = 1.0
            if column >= half:
                entry -= folded
                column -= half
                turned = -1.0
            similar[k, 0] = evidence[i, entry]
            x[k, 0] = turned * cosine[i, column]
            y[k, 0] = turned * sine[i, column]
            levels[k, 0] = normalized_dilation[i, column]
            total += rotation_weights[i]
            k += 1
        for k in range(count):
            x[k, 0] *= count / total
            y[k, 0] *= count / total
        result[g] = fmap_confidence(
            read_only(first),
            scratch,
            read_only(similar),
            read_only(x),
            read_only(y),
            read_only(levels),
            weights,
        )[0]
    return result
