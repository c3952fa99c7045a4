"""Outlines of cells and pixels, exactly along their borders."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sketchmatch.model import FloatArray

__all__ = ["outer_border", "outer_borders"]


def outer_border(mask: NDArray[np.uint8]) -> FloatArray:
    """Return the corners of the outer border of the one component of a mask's cells.

    See :func:`outer_borders`.
    """
    (border,) = outer_borders(mask)
    return border


def outer_borders(mask: NDArray[np.uint8]) -> list[FloatArray]:
    """Return the corners of the outer border of each component of a mask's cells.

    Drawn at twice the scale with cell corners at even pixels, a shape that includes its border
    has a pixel contour [1]_ that is that border, except that it cuts concave corners. Where two
    cells meet in a corner alone the cut is wanted: it keeps the outline from touching itself.

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
    rows, columns = mask.shape
    centres = np.zeros((2 * rows + 1, 2 * columns + 1), np.uint8)
    centres[1::2, 1::2] = mask
    shape = cv2.dilate(centres, np.ones((3, 3), np.uint8))
    contours, tree = cv2.findContours(shape, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    framed = np.pad(mask, 1)
    return [
        _through_corners(np.asarray(contour)[:, 0, :], framed)
        for contour, (*_, parent) in zip(contours, [] if tree is None else tree[0], strict=True)
        if parent < 0
    ]


def _through_corners(contour: NDArray[Any], framed: NDArray[np.uint8]) -> FloatArray:
    """Return a contour without its cuts, but for those where two cells meet in a corner alone."""
    following = np.concatenate([contour[1:], contour[:1]])
    corner = np.where(contour % 2 == 0, contour, following)
    cut = (contour != following).all(axis=1)
    cut[cut] = _filled_around(framed, corner[cut] // 2) == 3
    path = np.stack([contour, np.where(cut[:, None], corner, contour)], axis=1)
    return np.asarray(path.reshape(-1, 2) / 2.0, dtype=np.float64)


def _filled_around(framed: NDArray[np.uint8], corners: NDArray[Any]) -> NDArray[np.uint8]:
    """Return how many of the four cells around each corner (x, y) belong to a framed mask."""
    x, y = corners.T
    count: NDArray[np.uint8] = (
        framed[y, x] + framed[y, x + 1] + framed[y + 1, x] + framed[y + 1, x + 1]
    )
    return count
