"""The measure of Pappis and Karacapilidis."""

from __future__ import annotations

import numpy as np

from sketchmatch.api import Similarity
from sketchmatch.api.kernels import contrast_rows
from sketchmatch.model import FloatArray

__all__ = ["Pappis"]


class Pappis(Similarity):
    """What two histograms have in common, in proportion to what they cover: Σ min / Σ max.

    References
    ----------
    C. P. Pappis, N. I. Karacapilidis, "A comparative assessment of measures of similarity
    of fuzzy values", Fuzzy Sets and Systems 56(2), 1993.

    Examples
    --------
    Equal histograms, some with 3 of 5 in common, and some with nothing.

    >>> import numpy as np
    >>> template = np.array([[2.0, 2, 0, 0], [2, 2, 0, 0], [2, 2, 0, 0]])
    >>> argument = np.array([[2.0, 2, 0, 0], [3, 1, 0, 0], [0, 0, 2, 2]])
    >>> Pappis().compare(template, argument).tolist()
    [1.0, 0.6, 0.0]
    """

    name = "pappis"
    summary = "Sum of minima over sum of maxima (Pappis and Karacapilidis)."

    @classmethod
    def warm_up(cls) -> None:
        """Compile the kernel."""
        cls().compare(np.ones((1, 4)), np.ones((1, 4)))

    def compare(self, aligned: FloatArray, argument: FloatArray) -> FloatArray:
        """Return σ of each pair of rows, shape (k,)."""
        return contrast_rows(aligned, argument, 1.0, 1.0)
