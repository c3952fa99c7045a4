"""The overlap of two histograms, direction by direction."""

from __future__ import annotations

import numpy as np

from sketchmatch.api import Similarity
from sketchmatch.api.kernels import overlap_rows
from sketchmatch.model import FloatArray

__all__ = ["Overlap"]


class Overlap(Similarity):
    """Mean of min/max over the directions that are not empty.

    Every direction counts alike, however weak the force. Wang counts elements that are in neither
    fuzzy set as equal; here they are left out, because most directions of most histograms are
    empty and would make all pairs alike. A direction is empty where both histograms are below
    1e-9 of the larger one's peak.

    References
    ----------
    W.-J. Wang, "New similarity measures on fuzzy sets and on elements", Fuzzy Sets and
    Systems 85(3), 1997.

    Examples
    --------
    Of the second histograms 2/3 and 1/2 in the two directions in which there is something.

    >>> import numpy as np
    >>> template = np.array([[2.0, 2, 0, 0], [2, 2, 0, 0], [2, 2, 0, 0]])
    >>> argument = np.array([[2.0, 2, 0, 0], [3, 1, 0, 0], [0, 0, 2, 2]])
    >>> Overlap().compare(template, argument).round(3).tolist()
    [1.0, 0.583, 0.0]
    """

    name = "overlap"
    summary = "Mean of minimum over maximum, direction by direction (Wang)."

    @classmethod
    def warm_up(cls) -> None:
        """Compile the kernel."""
        cls().compare(np.ones((1, 4)), np.ones((1, 4)))

    def compare(self, aligned: FloatArray, argument: FloatArray) -> FloatArray:
        """Return σ of each pair of rows, shape (k,)."""
        return overlap_rows(aligned, argument)
