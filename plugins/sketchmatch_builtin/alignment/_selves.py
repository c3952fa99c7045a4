"""How alike single objects are, by the forces within each."""

from __future__ import annotations

import numpy as np

from sketchmatch.api.forces import OVERLAPPING, force_histograms
from sketchmatch.model import FloatArray, Scene

__all__ = ["self_similarities"]

_DIRECTIONS = 180


def self_similarities(drawn: Scene, mapped: Scene) -> FloatArray:
    """Return how alike the own histograms of objects are, for every turn.

    An object's own histogram F^aa, of constant forces, carries its shape and direction, and
    repeats after half a turn.

    Parameters
    ----------
    drawn, mapped
        The sketch and the map.

    Returns
    -------
    ndarray
        Shape (n, m, 90): the normalised cross-correlation of the first turned by k bins of 2°
        with the second.
    """
    first, second = _units(drawn), _units(mapped)
    spectra, others = np.conj(np.fft.rfft(first)), np.fft.rfft(second)
    products: FloatArray = np.fft.irfft(spectra[:, None] * others, first.shape[1])
    return products


def _units(scene: Scene) -> FloatArray:
    """Return the objects' own histograms over half a turn, in units of their norm."""
    pairs = np.repeat(np.arange(len(scene)), 2).reshape(-1, 2)
    overlapping = np.full(len(pairs), OVERLAPPING, dtype=np.int64)
    whole = force_histograms(scene.edges, pairs, _DIRECTIONS, 0.0, overlapping)
    half = whole[:, : _DIRECTIONS // 2]
    units: FloatArray = half / np.linalg.norm(half, axis=1, keepdims=True)
    return units
