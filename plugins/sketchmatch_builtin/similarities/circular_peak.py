"""The peak of the circular cross-correlation of two histograms."""

from __future__ import annotations

from sketchmatch.api import Alignment
from sketchmatch_builtin.similarities.cross_correlation import CrossCorrelation

__all__ = ["CircularPeak"]


class CircularPeak(CrossCorrelation):
    """Largest normalised cross-correlation over all rotations, by whole bins and between.

    R is the rotation of this maximum, so histograms without a clear main direction are aligned
    well, too. If two rotations fit equally, as for symmetric histograms, R is the smaller one.

    References
    ----------
    P. Matsakis, J. M. Keller, O. Sjahputera, J. Marjamaa, "The use of force histograms for
    affine-invariant relative position description", IEEE TPAMI 26(1), 2004.

    Examples
    --------
    The measure is that of ``cross-correlation``; the host aligns the histograms otherwise.

    >>> import numpy as np
    >>> CircularPeak.alignment.value
    'peak'
    >>> CircularPeak().compare(np.array([[2.0, 2, 0, 0]]), np.array([[3.0, 1, 0, 0]])).round(3)
    array([0.894])
    """

    name = "circular-peak"
    summary = "Cross-correlation at the rotation where it is largest; slower on large scenes."
    alignment = Alignment.PEAK
