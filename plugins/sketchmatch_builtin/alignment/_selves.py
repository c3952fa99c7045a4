"""How alike single objects are, by the forces within each."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from sketchmatch.api.forces import OVERLAPPING, force_histograms
from sketchmatch.model import FloatArray, Scene
from sketchmatch.model.arrays import ComplexArray, sealed

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
    spectra, others = np.conj(_spectra(drawn)), _spectra(mapped)
    products: FloatArray = np.fft.irfft(spectra[:, None] * others, _DIRECTIONS // 2)
    return products


@lru_cache(maxsize=32)
def _spectra(scene: Scene) -> ComplexArray:
    """Return the Fourier transforms of the objects' own histograms over half a turn.

    The histograms are in units of their norm. A map is asked for with each sketch of it.
    """
    pairs = np.repeat(np.arange(len(scene)), 2).reshape(-1, 2)
    overlapping = np.full(len(pairs), OVERLAPPING, dtype=np.int64)
    whole = force_histograms(scene.edges, pairs, _DIRECTIONS, 0.0, overlapping)
    half = whole[:, : _DIRECTIONS // 2]
    return sealed(np.fft.rfft(half / np.linalg.norm(half, axis=1, keepdims=True)))
