"""The constant-force histogram."""

from __future__ import annotations

from sketchmatch_builtin.histograms._forces import PowerForce

__all__ = ["ConstantForce"]


class ConstantForce(PowerForce):
    """Exact histogram of constant forces, r = 0, of polygons with holes, overlap allowed.

    Source: P. Matsakis, L. Wendling, "A new way to represent the relative position between areal
    objects", IEEE TPAMI 21(7), 1999; thesis, section 3.1.
    """

    name = "constant"
    summary = "Exact constant-force histogram (r = 0) of polygons."
    exponent = 0.0
