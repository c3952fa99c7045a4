"""The cross-correlation of two histograms."""

from __future__ import annotations

import numpy as np

from sketchmatch.api import ProductSimilarity
from sketchmatch.model import FloatArray

__all__ = ["CrossCorrelation"]


class CrossCorrelation(ProductSimilarity):
    """Normalised cross-correlation, Σ h₂h' / (‖h₂‖‖h'‖) [1]_, as the thesis [2]_ takes it.

    References
    ----------
    .. [1] P. Matsakis, J. M. Keller, O. Sjahputera, J. Marjamaa, "The use of force histograms for
       affine-invariant relative position description", IEEE TPAMI 26(1), 2004.
    .. [2] "Scene Matching Between a Quantitative Map and a Qualitative Hand Drawn Sketch", thesis,
       section 3.2.

    Examples
    --------
    Equal histograms, a cosine of 8 / √80, and histograms with nothing in common.

    >>> import numpy as np
    >>> template = np.array([[2.0, 2, 0, 0], [2, 2, 0, 0], [2, 2, 0, 0]])
    >>> argument = np.array([[2.0, 2, 0, 0], [3, 1, 0, 0], [0, 0, 2, 2]])
    >>> CrossCorrelation().compare(template, argument).round(3).tolist()
    [1.0, 0.894, 0.0]
    """

    name = "cross-correlation"
    summary = "Normalised cross-correlation of the aligned histograms."
    default = True

    def combine(
        self, product: FloatArray, template_square: FloatArray, argument_square: FloatArray
    ) -> FloatArray:
        """Return σ of pairs of histograms."""
        cosine = product / np.sqrt(template_square * argument_square)
        return np.clip(cosine, 0.0, 1.0)
