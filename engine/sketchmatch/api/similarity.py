"""The interface of similarity measures: how alike two aligned histograms are."""

from __future__ import annotations

from abc import ABC, abstractmethod

from sketchmatch.api._algorithm import Algorithm
from sketchmatch.model import FloatArray

__all__ = ["Similarity"]


class Similarity(Algorithm, ABC):
    """Compares histograms that the host has already dilated and rotated onto each other."""

    @abstractmethod
    def compare(self, aligned: FloatArray, argument: FloatArray) -> FloatArray:
        """Return the similarity σ of each row of ``aligned`` with the same row of ``argument``.

        Parameters
        ----------
        aligned
            Shape (k, directions), template histograms, dilated and rotated; no row is
            all zero.
        argument
            Shape (k, directions), argument histograms; no row is all zero.

        Returns
        -------
        ndarray
            Shape (k,), within [0, 1]; 1 for equal histograms.
        """
