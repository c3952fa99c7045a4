"""Lines pulled smooth on a grid, as far as they stay clear of what is on it."""

from __future__ import annotations

import math

from sketchmatch.kernels._jit import kernel
from sketchmatch.model.arrays import Float32Array, FloatArray

__all__ = ["pull_smooth"]


@kernel
def pull_smooth(
    points: FloatArray, clearance: Float32Array, room: float, rounds: int, parts: int
) -> None:
    """Move each point of a line towards the middle of its neighbours, again and again.

    Every second point is moved, then the others; one whose legs to its neighbours would come too
    near to something stays where it is, and so do the ends.

    Parameters
    ----------
    points
        Shape (k, 2), row and column in units of cells, which is written to.
    clearance
        Shape (rows, columns): how much room there is in each cell.
    room
        How much there has to be.
    rounds
        How often.
    parts
        Into how many parts a leg is cut, at the ends of which it is looked at.

    Examples
    --------
    >>> import numpy as np
    >>> corner = np.array([[0.5, 0.5], [0.5, 2.5], [2.5, 2.5]])
    >>> pull_smooth(corner, np.ones((3, 3), np.float32), 0.5, 1, 4)
    >>> corner.tolist()
    [[0.5, 0.5], [1.0, 2.0], [2.5, 2.5]]
    """
    rows, columns = clearance.shape
    for _ in range(rounds):
        for first in (1, 2):
            for k in range(first, len(points) - 1, 2):
                y = 0.5 * points[k, 0] + 0.25 * (points[k - 1, 0] + points[k + 1, 0])
                x = 0.5 * points[k, 1] + 0.25 * (points[k - 1, 1] + points[k + 1, 1])
                clear = True
                for other in (k - 1, k + 1):
                    dy, dx = points[other, 0] - y, points[other, 1] - x
                    for part in range(parts + 1):
                        share = part / parts
                        row, column = math.floor(y + share * dy), math.floor(x + share * dx)
                        if (
                            row < 0
                            or column < 0
                            or row >= rows
                            or column >= columns
                            or clearance[row, column] < room
                        ):
                            clear = False
                            break
                    if not clear:
                        break
                if clear:
                    points[k, 0], points[k, 1] = y, x
