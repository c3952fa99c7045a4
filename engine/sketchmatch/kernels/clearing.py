"""How far lines stay from the squares that are the occupied cells of a grid, exactly."""

from __future__ import annotations

import math

import numpy as np

from sketchmatch.kernels._jit import kernel
from sketchmatch.model.arrays import BoolArray, Float32Array, FloatArray

__all__ = ["legs_clear"]

_DIAGONAL = math.sqrt(2.0)


@kernel
def legs_clear(
    points: FloatArray, blocked: BoolArray, room: Float32Array, radius: float
) -> BoolArray:
    """Return which legs of a line are everywhere as far as a radius from what is blocked.

    Beyond the grid all is blocked.

    Parameters
    ----------
    points
        Shape (k, 2), row and column in units of cells.
    blocked
        Shape (rows, columns).
    room
        Shape (rows, columns): how far each cell is from the nearest that is blocked, square from
        square, in cells; a little less is as good.
    radius
        At least half a cell.

    Returns
    -------
    ndarray
        Shape (k − 1,).

    Examples
    --------
    Along a wall, one cell away from it and then half a cell:

    >>> blocked = np.array([[True] * 6, [False] * 6, [False] * 6, [False] * 6])
    >>> room = np.array([[0] * 6, [0] * 6, [1] * 6, [2] * 6], np.float32)
    >>> line = np.array([[2.0, 1.0], [2.0, 3.0], [1.5, 5.0]])
    >>> legs_clear(line, blocked, room, 1.0)
    array([ True, False])
    """
    found = np.empty(max(0, len(points) - 1), dtype=np.bool_)
    for k in range(found.size):
        dy, dx = points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1]
        pieces = max(1, math.ceil(math.sqrt(dy * dy + dx * dx)))
        found[k] = True
        for piece in range(pieces):
            first, last = piece / pieces, (piece + 1) / pieces
            a = (points[k, 0] + first * dy, points[k, 1] + first * dx)
            b = (points[k, 0] + last * dy, points[k, 1] + last * dx)
            if not _piece_clear(a, b, blocked, room, radius):
                found[k] = False
                break
    return found


@kernel
def _piece_clear(
    a: tuple[float, float],
    b: tuple[float, float],
    blocked: BoolArray,
    room: Float32Array,
    radius: float,
) -> bool:
    """Whether a piece of a line, no longer than a cell, is as far as a radius from all blocked."""
    rows, columns = blocked.shape
    for y, x in (a, b):
        if min(y, rows - y, x, columns - x) < radius:
            return False
    y, x = 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])
    row, column = math.floor(y), math.floor(x)
    half = 0.5 * math.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2)
    least = float(room[row, column])
    if least >= radius + half:
        return True
    if least + _DIAGONAL < radius:
        return False
    # Only cells between these distances, middle from middle, can be blocked and too near.
    farthest = radius + half + _DIAGONAL
    for i in range(max(0, math.floor(row - farthest)), min(rows, math.ceil(row + farthest) + 1)):
        aside = float(i - row) ** 2
        if aside > farthest * farthest:
            continue
        reach = math.ceil(math.sqrt(farthest * farthest - aside))
        inner = max(0, math.floor(math.sqrt(max(0.0, least * least - aside))) - 1)
        for left, right in ((column - reach, column - inner), (column + inner, column + reach)):
            for j in range(max(0, left), min(columns, right + 1)):
                if blocked[i, j] and _square_of_distance(a, b, i, j) < radius * radius:
                    return False
    return True


@kernel
def _square_of_distance(a: tuple[float, float], b: tuple[float, float], i: int, j: int) -> float:
    """Return the squared distance of a piece of a line from a cell that it does not cross."""
    least = math.inf
    for y, x in (a, b):
        dy, dx = max(i - y, y - i - 1.0, 0.0), max(j - x, x - j - 1.0, 0.0)
        least = min(least, dy * dy + dx * dx)
    dy, dx = b[0] - a[0], b[1] - a[1]
    length = dy * dy + dx * dx
    if length > 0.0:
        for v in (float(i), i + 1.0):
            for u in (float(j), j + 1.0):
                share = ((v - a[0]) * dy + (u - a[1]) * dx) / length
                share = min(1.0, max(0.0, share))
                y, x = v - a[0] - share * dy, u - a[1] - share * dx
                least = min(least, y * y + x * x)
    return least
