"""Objects made of pixels: filled polygons, the pixels that outlines cross, outlines of pixels."""

from __future__ import annotations

import numpy as np

from sketchmatch.kernels._jit import kernel
from sketchmatch.model.arrays import BoolArray, FloatArray, IntArray

__all__ = ["crossed_pixels", "filled_pixels", "pixel_edges"]

_TOUCH = 1e-6
"""In pixels: what reaches no farther into one touches it, up to rounding."""


@kernel
def filled_pixels(starts: FloatArray, ends: FloatArray, rows: int, columns: int) -> BoolArray:
    """Return the pixels whose centres lie inside an outline.

    Parameters
    ----------
    starts, ends
        Shape (e, 2): directed edges, in pixels, the grid's lower left corner in the origin.
    rows, columns
        Size of the grid.

    Returns
    -------
    ndarray
        Shape (rows, columns), row 0 at the bottom.

    Examples
    --------
    A triangle over three by two pixels:

    >>> corners = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 2.0]])
    >>> filled_pixels(corners, np.roll(corners, -1, axis=0), 2, 3).astype(int)
    array([[1, 1, 0],
           [1, 0, 0]])
    """
    inside = np.zeros((rows, columns), dtype=np.bool_)
    for e in range(starts.shape[0]):
        x0, y0, x1, y1 = starts[e, 0], starts[e, 1], ends[e, 0], ends[e, 1]
        if y0 > y1:
            x0, y0, x1, y1 = x1, y1, x0, y0
        # Rows with y0 ≤ centre < y1, so that a corner counts for one of its edges alone.
        first, last = max(0, int(np.ceil(y0 - 0.5))), min(rows, int(np.ceil(y1 - 0.5)))
        for row in range(first, last):
            x = x0 + (x1 - x0) * ((row + 0.5 - y0) / (y1 - y0))
            column = max(0, int(np.ceil(x - 0.5)))
            if column < columns:
                inside[row, column] = not inside[row, column]
    for row in range(rows):
        for column in range(1, columns):
            inside[row, column] ^= inside[row, column - 1]
    return inside


@kernel
def crossed_pixels(starts: FloatArray, ends: FloatArray, rows: int, columns: int) -> BoolArray:
    """Return the pixels that the edges of an outline go through.

    With those whose centres lie inside (:func:`filled_pixels`) they are all pixels of which the
    outline encloses a part, however small: what no edge goes through is inside or outside as its
    centre is.

    Parameters
    ----------
    starts, ends
        Shape (e, 2): edges, in pixels, the grid's lower left corner in the origin.
    rows, columns
        Size of the grid.

    Returns
    -------
    ndarray
        Shape (rows, columns), row 0 at the bottom. An edge along a side of a pixel, or through a
        corner of it alone, does not go through it, nor does what reaches less than a millionth of
        its side into it.

    Examples
    --------
    A triangle over three by two pixels:

    >>> corners = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 2.0]])
    >>> crossed_pixels(corners, np.roll(corners, -1, axis=0), 2, 3).astype(int)
    array([[0, 1, 1],
           [1, 1, 0]])
    """
    crossed = np.zeros((rows, columns), dtype=np.bool_)
    for e in range(starts.shape[0]):
        x0, y0, x1, y1 = starts[e, 0], starts[e, 1], ends[e, 0], ends[e, 1]
        if y0 > y1:
            x0, y0, x1, y1 = x1, y1, x0, y0
        first, last = max(0, int(np.floor(y0 + _TOUCH))), min(rows, int(np.ceil(y1 - _TOUCH)))
        for row in range(first, last):
            a, b = x0, x1
            if y0 < row:
                a = x0 + (x1 - x0) * ((row - y0) / (y1 - y0))
            if y1 > row + 1:
                b = x0 + (x1 - x0) * ((row + 1 - y0) / (y1 - y0))
            low, high = min(a, b), max(a, b)
            left, right = int(np.floor(low + _TOUCH)), int(np.ceil(high - _TOUCH))
            for column in range(max(0, left), min(columns, right)):
                crossed[row, column] = True
    return crossed


def pixel_edges(mask: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return the outline of a set of pixels, each the unit square at its column and row.

    Parameters
    ----------
    mask
        Shape (rows, columns), row 0 at the bottom.

    Returns
    -------
    starts, ends
        Shape (e, 2): the directed edges, the pixels on their left, as long as they go straight.

    Examples
    --------
    Two pixels beside each other are a rectangle of four edges:

    >>> starts, ends = pixel_edges(np.array([[True, True, False]]))
    >>> np.concatenate([starts, ends], axis=1)
    array([[0., 1., 0., 0.],
           [2., 0., 2., 1.],
           [0., 0., 2., 0.],
           [2., 1., 0., 1.]])
    """
    padded = np.pad(mask, 1).astype(np.int8)
    # −1 where an edge runs down or to the left, 1 where it runs up or to the right.
    upright = _runs(-np.diff(padded[1:-1], axis=1).T)
    level = _runs(np.diff(padded[:, 1:-1], axis=0))
    starts = np.concatenate([upright[:, [0, 1]], level[:, [1, 0]]])
    ends = np.concatenate([upright[:, [0, 2]], level[:, [2, 0]]])
    return starts.astype(np.float64), ends.astype(np.float64)


def _runs(signs: IntArray) -> IntArray:
    """Return (line, start, end) of each run of equal signs in the lines of an array.

    A run of −1 starts at its far end.
    """
    padded = np.pad(signs, ((0, 0), (1, 1)))
    changes = padded[:, 1:] != padded[:, :-1]
    begins, ends = changes[:, :-1] & (signs != 0), changes[:, 1:] & (signs != 0)
    lines, low = np.nonzero(begins)
    high = np.nonzero(ends)[1] + 1
    falling = signs[lines, low] < 0
    runs: IntArray = np.stack(
        [lines, np.where(falling, high, low), np.where(falling, low, high)], axis=1
    )
    return runs
