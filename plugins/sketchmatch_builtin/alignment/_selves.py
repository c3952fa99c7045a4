"""How alike single objects are, by the forces within each."""

from __future__ import annotations

import numpy as np

from sketchmatch.api.forces import OWN_DIRECTIONS, own_histograms
from sketchmatch.model import FloatArray, Scene
from sketchmatch.model.arrays import ComplexArray

__all__ = ["self_similarities"]


def self_similarities(drawn: Scene, mapped: Scene) -> FloatArray:
    """Return how alike the own histograms of objects are, for every turn.

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
    products: FloatArray = np.fft.irfft(spectra[:, None] * others, OWN_DIRECTIONS // 2)
    return products


def _spectra(scene: Scene) -> ComplexArray:
    """Return the Fourier transforms of the objects' own histograms, in units of their norm."""
    half = own_histograms(scene.objects)
    spectra: ComplexArray = np.fft.rfft(half / np.linalg.norm(half, axis=1, keepdims=True))
    return spectra
