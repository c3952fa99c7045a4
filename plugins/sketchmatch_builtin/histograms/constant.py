"""The constant-force histogram."""

from __future__ import annotations

from sketchmatch_builtin.histograms._forces import PowerForce

__all__ = ["ConstantForce"]


class ConstantForce(PowerForce):
    """Exact histogram of constant forces [1]_, r = 0, of polygons with holes, overlap allowed.

    It is what scenes are described by in [2]_.

    References
    ----------
    .. [1] P. Matsakis, L. Wendling, "A new way to represent the relative position between areal
       objects", IEEE TPAMI 21(7), 1999.
    .. [2] "Scene Matching Between a Quantitative Map and a Qualitative Hand Drawn Sketch", thesis,
       section 3.1.
    """

    name = "constant"
    summary = "Exact constant-force histogram (r = 0) of polygons."
    default = True
    exponent = 0.0
