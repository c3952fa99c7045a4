"""Histograms of masks and of points by counting pairs, one offset or one angle at a time."""

from collections import Counter
from functools import cache

import numpy as np

from tests.oracle.laws import force, law_histogram

PIXEL = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def mask_histogram(a, b, r, directions):
    """Return the histogram of forces of one mask's pixels on another's; row 0 is the top."""
    ways = Counter(
        (int(ja - jb), int(ib - ia)) for ia, ja in np.argwhere(a) for ib, jb in np.argwhere(b)
    )
    return sum(count * pixel_force(way, float(r), directions) for way, count in ways.items())


@cache
def pixel_force(way, r, directions):
    """Return the histogram of a unit square moved this way (right, up) on the square itself."""
    return law_histogram([PIXEL + way], [PIXEL], force(r), directions)


def angle_counts(points_a, points_b, bins):
    """Return how many pairs of points have a in each sector of b, sector 0 about +x."""
    x, y = (points_a[:, None] - points_b[None]).reshape(-1, 2).T
    apart = (x != 0) | (y != 0)
    turns = np.arctan2(y[apart], x[apart]) / (2 * np.pi)
    return np.bincount(np.floor(turns * bins + 0.5).astype(int) % bins, minlength=bins)
