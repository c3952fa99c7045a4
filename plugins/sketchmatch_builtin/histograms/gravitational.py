"""The gravitational-force histogram."""

from __future__ import annotations

from sketchmatch_builtin.histograms._forces import PowerForce

__all__ = ["GravitationalForce"]


class GravitationalForce(PowerForce):
    """Exact histogram of gravitational forces, r = 2, of polygons that do not touch.

    It tells more of the parts of two objects that are near each other than of the others.

    References
    ----------
    P. Matsakis, L. Wendling, "A new way to represent the relative position between areal
    objects", IEEE TPAMI 21(7), 1999.
    """

    name = "gravitational"
    summary = "Exact gravitational-force histogram (r = 2) of polygons that do not touch."
    exponent = 2.0
