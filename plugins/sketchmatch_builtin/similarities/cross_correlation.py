"""The cross-correlation of two histograms."""

from __future__ import annotations

import numpy as np

from sketchmatch.api import Similarity
from sketchmatch.api.kernels import cosine_rows
from sketchmatch.model import FloatArray

__all__ = ["CrossCorrelation"]


class CrossCorrelation(Similarity):
    """Normalised cross-correlation, Σ h₂h' / (‖h₂‖‖h'‖).

    Source: P. Matsakis, J. M. Keller, O. Sjahputera, J. Marjamaa, "The use of force histograms for
    affine-invariant relative position description", IEEE TPAMI 26(1), 2004; thesis, section 3.2.
    """

    name = "cross-correlation"
    summary = "Normalised cross-correlation of the aligned histograms."

    @classmethod
    def warm_up(cls) -> None:
        """Compile the kernel."""
        cls().compare(np.ones((1, 4)), np.ones((1, 4)))

    def compare(self, aligned: FloatArray, argument: FloatArray) -> FloatArray:
        """Return σ of each pair of rows, shape (k,)."""
        return np.minimum(cosine_rows(aligned, argument), 1.0)
