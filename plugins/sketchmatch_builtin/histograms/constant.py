"""The constant-force histogram."""

from __future__ import annotations

from sketchmatch_builtin.histograms._forces import PowerForce

__all__ = ["ConstantForce"]


class ConstantForce(PowerForce):
    """Exact histogram of constant forces [1]_, r = 0, of polygons with holes, overlap allowed.

    The thesis [2]_ describes scenes by it.

    References
    ----------
    .. [1] P. Matsakis, L. Wendling, "A new way to represent the relative position between areal
       objects", IEEE TPAMI 21(7), 1999.
    .. [2] "Scene Matching Between a Quantitative Map and a Qualitative Hand Drawn Sketch", thesis,
       section 3.1.

    Examples
    --------
    The second of two unit squares is to the right of the first, in direction 0, where forces of
    1 act between all 1 × 1 pairs of their points on a line, over a breadth of 1.

    >>> import numpy as np
    >>> from sketchmatch.model import Scene
    >>> square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    >>> scene = Scene.from_polygons([square, square + [3, 0]])
    >>> params = ConstantForce.Params(directions=4)
    >>> ConstantForce(params).describe(scene, np.array([[1, 0]])).tolist()
    [[1.0, 0.0, 0.0, 0.0]]
    """

    name = "constant"
    summary = "Exact constant-force histogram (r = 0) of polygons."
    default = True
    exponent = 0.0
