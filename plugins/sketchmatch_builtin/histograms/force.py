"""The histogram of forces d^−r for any r."""

from __future__ import annotations

from sketchmatch.api.forces import ForceParams
from sketchmatch_builtin.histograms._forces import PowerForce

__all__ = ["Force"]


class Force(PowerForce):
    """Exact histogram of the forces d^−r of polygons.

    Objects may overlap for r < 1 and touch for r < 2. For a match r must not be near 3, where a
    histogram does not change with the size of its objects.

    References
    ----------
    P. Matsakis, L. Wendling, "A new way to represent the relative position between areal
    objects", IEEE TPAMI 21(7), 1999.

    Examples
    --------
    Of unit squares 3 apart, 10 ln 2 − 6 ln 3 in direction 0 for r = 1.

    >>> import numpy as np
    >>> from sketchmatch.model import Scene
    >>> square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    >>> scene = Scene.from_polygons([square, square + [3, 0]])
    >>> params = Force.Params(directions=4, r=1.0)
    >>> Force(params).describe(scene, np.array([[1, 0]])).round(4).tolist()
    [[0.3398, 0.0, 0.0, 0.0]]
    """

    name = "force"
    summary = "Exact histogram of the forces d^-r of polygons, for any real r."

    class Params(ForceParams):
        """The number of directions, and the exponent."""

    params: Params

    @property
    def exponent(self) -> float:
        """r."""
        return self.params.r
