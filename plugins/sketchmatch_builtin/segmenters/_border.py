"""Outlines of cells and pixels, exactly along their borders."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sketchmatch.model import FloatArray

__all__ = ["outer_border"]


def outer_border(mask: NDArray[np.uint8]) -> FloatArray:
    """Return the corners of the outer border of a mask's cells.

    Drawn at twice the scale with cell corners at even pixels, a shape that includes its border
    has a pixel contour [1]_ that is that border, except that it cuts concave corners. Where two
    cells meet in a corner alone the cut is wanted: it keeps the outline from touching itself.

    Parameters
    ----------
    mask
        Shape (rows, columns), 1 in one component of cells joined by sides or corners, without
        holes, and 0 elsewhere.

    Returns
    -------
    ndarray
        Shape (k, 2), points (x, y) in cells from the corner of cell (0, 0), x along columns;
        a ring that does not touch itself. It encloses the cells' area, and a quarter of a cell
        more for every corner in which two cells meet alone.

    References
    ----------
    .. [1] S. Suzuki, K. Abe, "Topological structural analysis of digitized binary images by
       border following", Computer Vision, Graphics, and Image Processing 30(1), 1985.
    """
    rows, columns = mask.shape
    centres = np.zeros((2 * rows + 1, 2 * columns + 1), np.uint8)
    centres[1::2, 1::2] = mask
    shape = cv2.dilate(centres, np.ones((3, 3), np.uint8))
    contours, _ = cv2.findContours(shape, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    contour: NDArray[Any] = contours[0][:, 0, :]
    following = np.concatenate([contour[1:], contour[:1]])
    corner = np.where(contour % 2 == 0, contour, following)
    cut = (contour != following).all(axis=1)
    cut[cut] = _filled_around(mask, corner[cut] // 2) == 3
    path = np.stack([contour, np.where(cut[:, None], corner, contour)], axis=1)
    return np.asarray(path.reshape(-1, 2) / 2.0, dtype=np.float64)


def _filled_around(mask: NDArray[np.uint8], corners: NDArray[Any]) -> NDArray[np.uint8]:
    """Return how many of the four cells around each corner (x, y) belong to the mask."""
    framed = np.pad(mask, 1)
    x, y = corners.T
    count: NDArray[np.uint8] = (
        framed[y, x] + framed[y, x + 1] + framed[y + 1, x] + framed[y + 1, x + 1]
    )
    return count
