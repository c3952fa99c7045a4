"""Outlines of cells and pixels, exactly along their borders."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sketchmatch.model import FloatArray, IntArray

__all__ = ["outer_border", "outer_borders"]

# Directions, each by an eighth to the left of the last as seen with rows downwards: what (x, y)
# leads there, and the number of (x + 1, y + 1).
_AROUND = np.array([[1, 0], [1, -1], [0, -1], [-1, -1], [-1, 0], [-1, 1], [0, 1], [1, 1]])
_NUMBERS = np.empty((3, 3), np.int64)
_NUMBERS[tuple(_AROUND.T + 1)] = np.arange(8)
# As if one came to a cell that is alone from above, and saw all that is around it.
_NUMBERS[1, 1] = 2
# The side of a cell in each direction that is one of a side: where it begins, and where it leads,
# with the cell on the left.
_BEGINNING = np.array([[1, 1], [1, 0], [0, 0], [0, 1]])
_HEADING = np.array([[0, -1], [-1, 0], [0, 1], [1, 0]])
# Cells.
_AT_ONCE = 20_000


def outer_border(mask: NDArray[np.uint8]) -> FloatArray:
    """Return the corners of the outer border of the one component of a mask's cells.

    See :func:`outer_borders`.
    """
    (border,) = outer_borders(mask)
    return border


def outer_borders(mask: NDArray[np.uint8]) -> list[FloatArray]:
    """Return the corners of the outer border of each component of a mask's cells.

    Of the cells along a border [1]_, the sides between the one before and the one after are
    passed, with the component on the left. Where two cells meet in a corner alone it is cut: that
    keeps the outline from touching itself.

    Parameters
    ----------
    mask
        Shape (rows, columns), 1 in components of cells joined by sides or corners, also within
        each other, and 0 elsewhere.

    Returns
    -------
    list of ndarray
        Shape (k, 2) each, points (x, y) in cells from the corner of cell (0, 0), x along columns;
        a ring that does not touch itself, begun at the left upper corner of the leftmost cell of
        the component's first row. It encloses the cells' area and all within, and a quarter of a
        cell more for every corner in which two cells meet alone.

    References
    ----------
    .. [1] S. Suzuki, K. Abe, "Topological structural analysis of digitized binary images by
       border following", Computer Vision, Graphics, and Image Processing 30(1), 1985.
    """
    contours, tree = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    around = [
        np.asarray(contour)[:, 0, :]
        for contour, (*_, parent) in zip(contours, [] if tree is None else tree[0], strict=True)
        if parent < 0
    ]
    framed = np.pad(mask, 1)
    return [border for rings in _together(around) for border in _along_sides(rings, framed)]


def _together(rings: list[NDArray[Any]]) -> Iterator[list[NDArray[Any]]]:
    """Yield rings of cells, so many at once that neither calls nor memory cost much."""
    number = np.cumsum([len(ring) for ring in rings]) // _AT_ONCE
    starts = [0, *(np.flatnonzero(np.diff(number)) + 1).tolist(), len(rings)]
    yield from (rings[low:high] for low, high in itertools.pairwise(starts) if low < high)


def _along_sides(rings: list[NDArray[Any]], framed: NDArray[np.uint8]) -> list[FloatArray]:
    """Return the corners of the borders along rings of cells (x, y) of a framed mask."""
    cells, ends = np.concatenate(rings), np.cumsum([len(ring) for ring in rings])
    lengths = np.diff(ends, prepend=0)
    before = _direction(cells[_following(ends, lengths, -1)] - cells)
    after = _direction(cells[_following(ends, lengths, 1)] - cells)
    passed = (after - before - 1) % 8
    passed[ends[lengths == 1] - 1] = 8
    slanted = before % 2 > 0
    sides = (passed + slanted) // 2
    until = sides.cumsum()
    cell = np.repeat(np.arange(len(cells)), sides)
    number = np.arange(len(cell)) - (until - sides)[cell]
    side = ((before // 2)[cell] + 1 + number) % 4
    # The left side of each ring's first cell comes first.
    ends, starts = until[ends - 1], ends - lengths
    lengths = np.diff(ends, prepend=0)
    first = (until - sides)[starts] + (1 - (before // 2)[starts]) % 4
    order = _following(ends, lengths, first - (ends - lengths))
    cell, number, side = cell[order], number[order], side[order]
    last = side[_following(ends, lengths, -1)]
    ring = np.repeat(np.arange(len(ends)), lengths)
    turns = side != last
    cell, number, side, last, ring = (each[turns] for each in (cell, number, side, last, ring))
    corners = cells[cell] + _BEGINNING[side]
    cut = slanted[cell] & (number == 0)
    cut[cut] = _filled_around(framed, corners[cut]) == 2
    aside = cut[:, None] / 2.0
    path = np.stack([corners - aside * _HEADING[last], corners + aside * _HEADING[side]], axis=1)
    # A side that is cut at both ends is a point.
    apart = np.ones(len(path), np.bool_)
    apart[1:] = (path[1:, 0] != path[:-1, 1]).any(axis=1)
    kept = np.stack([apart, cut], axis=1)
    corners = np.asarray(path[kept], dtype=np.float64)
    return np.split(corners, kept.sum(axis=1).cumsum()[np.flatnonzero(np.diff(ring))])


def _following(ends: IntArray, lengths: IntArray, steps: int | IntArray) -> IntArray:
    """Return for each place in rings that of so many steps after it."""
    starts, lengths, steps = (
        np.repeat(each, lengths)
        for each in (ends - lengths, lengths, np.broadcast_to(steps, lengths.shape))
    )
    return np.asarray(starts + (np.arange(len(starts)) - starts + steps) % lengths)


def _direction(steps: NDArray[Any]) -> NDArray[np.int64]:
    x, y = steps.T + 1
    return np.asarray(_NUMBERS[x, y], dtype=np.int64)


def _filled_around(framed: NDArray[np.uint8], corners: NDArray[Any]) -> NDArray[np.uint8]:
    """Return how many of the four cells around each corner (x, y) belong to a framed mask."""
    x, y = corners.T
    count: NDArray[np.uint8] = (
        framed[y, x] + framed[y, x + 1] + framed[y + 1, x] + framed[y + 1, x + 1]
    )
    return count
