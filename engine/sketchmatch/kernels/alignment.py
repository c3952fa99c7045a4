"""Turning and dilating template histograms onto argument histograms."""

from __future__ import annotations

import numpy as np

from sketchmatch.kernels._jit import kernel
from sketchmatch.model.arrays import FloatArray

__all__ = ["cosine_rows", "main_directions", "rotated_rows"]


def main_directions(histograms: FloatArray) -> FloatArray:
    """Return the mean direction of each histogram, atan2(Σ h sin θ, Σ h cos θ).

    Parameters
    ----------
    histograms
        Shape (k, n).

    Returns
    -------
    ndarray
        Shape (k,), radians within (−π, π]; 0 for a histogram without any main direction.
    """
    angles = 2.0 * np.pi * np.arange(histograms.shape[1]) / histograms.shape[1]
    directions: FloatArray = np.arctan2(histograms @ np.sin(angles), histograms @ np.cos(angles))
    return directions


@kernel
def rotated_rows(histogram: FloatArray, rotations: FloatArray, factors: FloatArray) -> FloatArray:
    """Return one histogram turned by each of many angles and multiplied by each of many factors.

    Between bins it is read by periodic linear interpolation: h2(θ) = factor · h(θ − rotation).

    Parameters
    ----------
    histogram
        Shape (n,).
    rotations
        Shape (k,), radians within [0, 2π).
    factors
        Shape (k,).

    Returns
    -------
    ndarray
        Shape (k, n).
    """
    n = histogram.size
    rows = np.empty((rotations.size, n))
    for k in range(rotations.size):
        shift = rotations[k] * n / (2.0 * np.pi)
        whole = int(np.floor(shift))
        late = (shift - whole) * factors[k]
        early = factors[k] - late
        source = (-whole - 1) % n
        before = histogram[source]
        for m in range(n):
            source = source + 1 if source + 1 < n else 0
            here = histogram[source]
            rows[k, m] = early * here + late * before
            before = here
    return rows


@kernel
def cosine_rows(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return Σ xy / (‖x‖‖y‖) for each row x of ``first`` and the same row y of ``second``.

    Parameters
    ----------
    first, second
        Shape (k, n), no row all zero.

    Returns
    -------
    ndarray
        Shape (k,).
    """
    result = np.empty(first.shape[0])
    for k in range(first.shape[0]):
        product = square_first = square_second = 0.0
        for m in range(first.shape[1]):
            x, y = first[k, m], second[k, m]
            product += x * y
            square_first += x * x
            square_second += y * y
        result[k] = product / np.sqrt(square_first) / np.sqrt(square_second)
    return result
