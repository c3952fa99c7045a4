"""A line pulled smooth on a grid, point by point as it is defined."""

import numpy as np


def pulled(points, clearance, room, rounds, parts):
    """Return what :func:`sketchmatch.kernels.smoothing.pull_smooth` makes of a line."""
    points = np.array(points)
    for _ in range(rounds):
        for first in (1, 2):
            for k in range(first, len(points) - 1, 2):
                moved = 0.5 * points[k] + 0.25 * (points[k - 1] + points[k + 1])
                legs = [
                    moved + share * (points[other] - moved)
                    for other in (k - 1, k + 1)
                    for share in np.arange(parts + 1) / parts
                ]
                if all(_is_clear(place, clearance, room) for place in legs):
                    points[k] = moved
    return points


def _is_clear(place, clearance, room):
    row, column = np.floor(place).astype(int)
    rows, columns = clearance.shape
    inside = 0 <= row < rows and 0 <= column < columns
    return bool(inside and clearance[row, column] >= room)
