"""The histogram of forces d^−r for any r."""

from __future__ import annotations

from sketchmatch.api import HistogramParams
from sketchmatch_builtin.histograms._forces import PowerForce, exponent_field

__all__ = ["Force"]


class Force(PowerForce):
    """Exact histogram of the forces d^−r of polygons.

    Objects may overlap for r < 1 and touch for r < 2. For a match r must not be near 3, where a
    histogram does not change with the size of its objects.

    References
    ----------
    P. Matsakis, L. Wendling, "A new way to represent the relative position between areal
    objects", IEEE TPAMI 21(7), 1999.
    """

    name = "force"
    summary = "Exact histogram of the forces d^-r of polygons, for any real r."

    class Params(HistogramParams):
        """The number of directions, and the exponent."""

        r: float = exponent_field(1.0)

    params: Params

    @property
    def exponent(self) -> float:
        """r."""
        return self.params.r
