"""How well a direction describes a histogram of forces: the sums over half a turn of it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sketchmatch.kernels._jit import kernel
from sketchmatch.model.arrays import BoolArray, FloatArray, IntArray

__all__ = ["HalfTurns", "effective_forces"]


class HalfTurns(NamedTuple):
    """The bins of half a turn from each of some directions.

    Attributes
    ----------
    places, low, width, ahead
        Shape (d, k): which they are, how far off, how much of each, and whether they lie within a
        quarter turn, where one ends. Where a direction needs fewer, the last ones count nothing.
    """

    places: IntArray
    low: FloatArray
    width: FloatArray
    ahead: BoolArray


@kernel
def effective_forces(
    rows: FloatArray, turns: HalfTurns, sign: int
) -> tuple[FloatArray, FloatArray]:
    """Return the effective forces to one side of directions, and their first moments.

    What lies beyond a quarter turn is against a direction, and takes away from the forces before,
    those last that are farthest off.

    Parameters
    ----------
    rows
        Shape (m, n), none of it negative.
    turns
        Of the directions.
    sign
        1 for counter-clockwise of them, −1 for clockwise: then the rows are read backwards.

    Returns
    -------
    forces, moments : ndarray
        Shape (m, d); the moments are about the direction, in bins.

    Examples
    --------
    >>> quarter = HalfTurns(
    ...     np.array([[0, 1]]), np.array([[0.0, 1.0]]), np.ones((1, 2)), np.array([[True, False]])
    ... )
    >>> effective_forces(np.array([[3.0, 1.0, 0.0, 0.0]]), quarter, 1)
    (array([[2.]]), array([[0.66666667]]))
    """
    count, bins = rows.shape
    directions, steps = turns.places.shape
    effective, moments = np.zeros((count, directions)), np.zeros((count, directions))
    for i in range(count):
        row = rows[i]
        for d in range(directions):
            total = 0.0
            for k in range(steps):
                force = row[(sign * turns.places[d, k]) % bins] * turns.width[d, k]
                total += force if turns.ahead[d, k] else -force
            left = effective[i, d] = max(total, 0.0)
            for k in range(steps):
                if left <= 0.0:
                    break
                if not turns.ahead[d, k]:
                    continue
                force = row[(sign * turns.places[d, k]) % bins] * turns.width[d, k]
                if force <= 0.0:
                    continue
                kept = min(force, left)
                share = kept / force
                moments[i, d] += kept * (turns.low[d, k] + 0.5 * turns.width[d, k] * share)
                left -= kept
    return effective, moments
