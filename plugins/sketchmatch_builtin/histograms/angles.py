"""The histogram of angles."""

from __future__ import annotations

from sketchmatch_builtin.histograms._forces import PowerForce

__all__ = ["Angles"]


class Angles(PowerForce):
    """Exact histogram of the angles of all pairs of points, without counting pixels.

    In polar coordinates about a point b of B the point a of A lies at b + ρ(cos θ, sin θ), and
    da = ρ dρ dθ. The density of the angle θ over all pairs of points is therefore the histogram of
    the forces φ(d) = d, r = −1; its integral over the full turn is the product of the areas.

    References
    ----------
    K. Miyajima, A. Ralescu, "Spatial organization in 2D segmented images: representation
    and recognition of primitive spatial relations", Fuzzy Sets and Systems 65(2–3), 1994.

    Examples
    --------
    Over the full turn, the product of the areas: here 1 × 4.

    >>> import numpy as np
    >>> from sketchmatch.model import Scene
    >>> square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    >>> scene = Scene.from_polygons([square, 2 * square + [3, 0]])
    >>> params = Angles.Params(directions=360)
    >>> histograms = Angles(params).describe(scene, np.array([[1, 0]]))
    >>> round(float(histograms.sum() * np.radians(1.0)), 2)
    4.0
    """

    name = "angles"
    summary = "Histogram of the angles of all pairs of points, the classical baseline."
    exponent = -1.0
