"""The fuzzy feature contrast of Santini and Jain."""

from __future__ import annotations

from typing import Self

import numpy as np
from pydantic import Field, model_validator

from sketchmatch.api import Similarity
from sketchmatch.api.kernels import contrast_rows
from sketchmatch.model import FloatArray

__all__ = ["SantiniJain"]


class SantiniJain(Similarity):
    """Fuzzy feature contrast [1]_ in Tversky's ratio form [2]_, c / (c + αa + βb).

    c = Σ min(h₂, h') is what the histograms have in common, a = Σ max(h₂ − h', 0) what only the
    template has and b = Σ max(h' − h₂, 0) what only the argument has. The histograms have equal
    means, so a = b and only α + β counts: 1 is Dice's coefficient, 2 is ``pappis``.

    References
    ----------
    .. [1] S. Santini, R. Jain, "Similarity measures", IEEE TPAMI 21(9), 1999.
    .. [2] A. Tversky, "Features of similarity", Psychological Review 84(4), 1977.

    Examples
    --------
    The second histograms have c = 3 in common and a = b = 1 apart: 3 / (3 + α + β).

    >>> import numpy as np
    >>> template = np.array([[2.0, 2, 0, 0], [2, 2, 0, 0], [2, 2, 0, 0]])
    >>> argument = np.array([[2.0, 2, 0, 0], [3, 1, 0, 0], [0, 0, 2, 2]])
    >>> SantiniJain().compare(template, argument).tolist()
    [1.0, 0.75, 0.0]
    >>> SantiniJain(SantiniJain.Params(alpha=1.0, beta=1.0)).compare(template, argument).tolist()
    [1.0, 0.6, 0.0]
    """

    name = "santini-jain"
    summary = "Fuzzy feature contrast in Tversky's ratio form (Santini and Jain)."

    class Params(Similarity.Params):
        """How much differences count."""

        alpha: float = Field(
            0.5, ge=0, le=1000, description="Weight of what only the template histogram has."
        )
        beta: float = Field(
            0.5, ge=0, le=1000, description="Weight of what only the argument histogram has."
        )

        @model_validator(mode="after")
        def _some_difference_counts(self) -> Self:
            if self.alpha == self.beta == 0.0:
                raise ValueError(
                    "makes all histograms equal; give alpha or beta a value above zero"
                )
            return self

    params: Params

    @classmethod
    def warm_up(cls) -> None:
        """Compile the kernel."""
        cls().compare(np.ones((1, 4)), np.ones((1, 4)))

    def compare(self, aligned: FloatArray, argument: FloatArray) -> FloatArray:
        """Return σ of each pair of rows, shape (k,)."""
        return contrast_rows(aligned, argument, self.params.alpha, self.params.beta)
