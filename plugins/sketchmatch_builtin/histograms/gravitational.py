"""The gravitational-force histogram."""

from __future__ import annotations

from sketchmatch_builtin.histograms._forces import PowerForce

__all__ = ["GravitationalForce"]


class GravitationalForce(PowerForce):
    """Exact histogram of gravitational forces, r = 2, of polygons that do not touch.

    Parts of two objects that are near each other count more than the others.

    References
    ----------
    P. Matsakis, L. Wendling, "A new way to represent the relative position between areal
    objects", IEEE TPAMI 21(7), 1999.

    Examples
    --------
    Of unit squares 3 apart, ln 9/8 in direction 0.

    >>> import numpy as np
    >>> from sketchmatch.model import Scene
    >>> square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    >>> scene = Scene.from_polygons([square, square + [3, 0]])
    >>> params = GravitationalForce.Params(directions=4)
    >>> GravitationalForce(params).describe(scene, np.array([[1, 0]])).round(4).tolist()
    [[0.1178, 0.0, 0.0, 0.0]]
    """

    name = "gravitational"
    summary = "Exact gravitational-force histogram (r = 2) of polygons that do not touch."
    exponent = 2.0
