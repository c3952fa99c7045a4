"""An occupancy grid as a soft background: where its known cells are, and their picture."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from sketchmatch.model import FloatArray, OccupancyGrid
from sketchmatch.pictures._canvas import Box
from sketchmatch.pictures._palette import Colour, mixed

__all__ = ["known_area", "painted_cells"]

_UNKNOWN: Colour = (231, 235, 240)
_FREE: Colour = (255, 255, 255)
_OCCUPIED: Colour = (84, 97, 118)


def known_area(grid: OccupancyGrid) -> Box | None:
    """Return the box, in the map's frame, around all known cells; None where there is none."""
    known = grid.cells >= 0
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if not rows.size:
        return None
    low, high = (columns[0], rows[0]), (columns[-1] + 1, rows[-1] + 1)
    corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])]) * grid.resolution
    placed = corners @ _turning(grid.origin[2]).T + grid.origin[:2]
    (x0, y0), (x1, y1) = placed.min(axis=0).tolist(), placed.max(axis=0).tolist()
    return (x0, y0, x1, y1)


def painted_cells(
    grid: OccupancyGrid, size: tuple[int, int], corner: tuple[float, float], step: float
) -> Image.Image:
    """Paint the cells as they lie in the map's frame.

    Parameters
    ----------
    grid
        The cells and their pose.
    size
        Of the picture, in pixels.
    corner
        The picture's upper left corner, in the map's frame.
    step
        Metres a pixel.

    Returns
    -------
    PIL.Image.Image
        RGB, y down; free cells white, occupied dark, everything else unknown.
    """
    cells = Image.fromarray(_shades()[grid.cells.astype(np.int16) + 1])
    coarser = max(1, int(step / grid.resolution))
    if coarser > 1:
        cells = cells.reduce(coarser)
    cell = grid.resolution * coarser
    turn = _turning(-grid.origin[2]) / cell
    x, y = turn @ (np.array(corner) - grid.origin[:2])
    (a, b), (d, e) = turn * step
    return cells.transform(
        size,
        Image.Transform.AFFINE,
        (a, -b, x, d, -e, y),
        Image.Resampling.NEAREST,
        fillcolor=_UNKNOWN,
    )


def _shades() -> NDArray[np.uint8]:
    """Return the colour of each cell value from −1 to 100."""
    known = [mixed(_FREE, _OCCUPIED, value / 100.0) for value in range(101)]
    return np.array([_UNKNOWN, *known], dtype=np.uint8)


def _turning(angle: float) -> FloatArray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])
