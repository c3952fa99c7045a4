"""Exact histograms of hybrid forces, constant up to a distance and d^−2 beyond it, of polygons.

With x = d / Y for the distance Y where the force changes, φ = Y^−2 for x ≤ 1 and d^−2 beyond, so
Ψ = x² / 2 for x ≤ 1 and ½ + 2(x − 1) − ln x beyond. Where the objects do not touch, 2x − 3⁄2 is
left out of both, as it cancels in the sum over the edges, and what remains grows only as ln x.

References
----------
P. Matsakis, "Relations spatiales structurelles et interprétation d'images", thesis, Université
Paul Sabatier, Toulouse, 1998.
"""

from __future__ import annotations

from typing import NamedTuple

from sketchmatch.kernels._jit import kernel
from sketchmatch.kernels.power_force import (
    APART,
    PowerLaw,
    mean_potential,
    pair_power_force,
    power_law,
)
from sketchmatch.kernels.projection import Projection, Scratch
from sketchmatch.kernels.sweep import pair_sweep, sum_over_edges, sweep_pairs
from sketchmatch.model.arrays import BoolArray, FloatArray, IntArray

__all__ = ["hybrid_force_histograms"]


class _HybridLaw(NamedTuple):
    """The hybrid force: radius Y by pair, and the force beyond it."""

    radii: FloatArray
    beyond: PowerLaw


class _Line(NamedTuple):
    """The hybrid force for one pair of objects.

    Attributes
    ----------
    apart
        Whether what cancels may be left out.
    """

    radius: float
    apart: bool
    means: FloatArray


@kernel
def _mean(x0: float, x1: float, line: _Line) -> float:
    """Return the mean of Ψ for x from x0 to x1, both at least 0."""
    low, high = min(x0, x1), max(x0, x1)
    # Ψ without 2x − 3⁄2 beyond 1 is −ln x; below 1 it is (x − 1)(x − 3) / 2.
    if high <= 1.0:
        square = (low * low + low * high + high * high) / 6.0
        return square - (low + high) + 1.5 if line.apart else square
    share = (1.0 - low) / (high - low) if low < 1.0 else 0.0
    mean = (1.0 - share) * mean_potential(max(low, 1.0), high, 2, 2.0, line.means)
    if share > 0.0:
        mean += share * ((low * low + low + 1.0) / 6.0 - (low + 1.0) + 1.5)
    return mean if line.apart else mean + (low + high) - 1.5


@kernel
def _positive_mean(x0: float, x1: float, line: _Line) -> float:
    """Return the mean of Ψ(x) where x > 0 and 0 elsewhere, for x from x0 to x1."""
    if x0 <= 0.0 and x1 <= 0.0:
        return 0.0
    if x0 >= 0.0 and x1 >= 0.0:
        return _mean(x0, x1, line)
    peak = max(x0, x1)
    return _mean(0.0, peak, line) * (peak / abs(x1 - x0))


@kernel
def _edge_force(a0: float, a1: float, b0: float, b1: float, line: _Line) -> tuple[float, float]:
    x0, x1 = (a0 - b0) / line.radius, (a1 - b1) / line.radius
    return _positive_mean(x0, x1, line), _positive_mean(-x0, -x1, line)


_sum_over_edges = sum_over_edges(_edge_force)


@kernel
def _pair_force(
    projection: Projection, a: int, b: int, p: int, order: int, law: _HybridLaw
) -> tuple[float, float]:
    if law.radii[p] <= 0.0:
        return pair_power_force(projection, a, b, p, order, law.beyond)
    line = _Line(law.radii[p], law.beyond.relations[p] == APART, law.beyond.means)
    return _sum_over_edges(projection, a, b, line)


_compute = pair_sweep(_pair_force, sections=False)


@kernel
def _sweep(
    room: tuple[Projection, Scratch],
    starts: FloatArray,
    ends: FloatArray,
    used: BoolArray,
    pairs: IntArray,
    directions: int,
    law: _HybridLaw,
) -> FloatArray:
    return _compute(room, starts, ends, used, pairs, directions, law)


def hybrid_force_histograms(
    starts: FloatArray,
    ends: FloatArray,
    offsets: IntArray,
    pairs: IntArray,
    directions: int,
    radii: FloatArray,
    relations: IntArray,
) -> FloatArray:
    """Return the histograms of hybrid forces of pairs of objects.

    Parameters
    ----------
    starts, ends, offsets, pairs, directions
        As in :func:`~sketchmatch.kernels.constant_force.constant_force_histograms`.
    radii
        Shape (p,): the distance Y up to which the force of each pair is constant, or 0 for pairs
        that are further apart than it.
    relations
        Shape (p,): OVERLAPPING, TOUCHING, MEETING or APART for each pair.

    Returns
    -------
    ndarray
        Shape (p, n), in units of length.

    Examples
    --------
    Two unit squares, 1 apart along x. Up to a distance of 4 the force is constantly 1/16; where
    it is d^−2 at once it is ln 4 − ln 3, as lines meet both in a length of 1.

    >>> import numpy as np
    >>> corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> starts = np.concatenate([corners, corners + [2.0, 0.0]])
    >>> ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in (starts[:4], starts[4:])])
    >>> offsets, pairs = np.array([0, 4, 8]), np.array([[1, 0], [1, 0]])
    >>> radii, relations = np.array([4.0, 0.0]), np.array([3, 3])
    >>> found = hybrid_force_histograms(starts, ends, offsets, pairs, 4, radii, relations)
    >>> found.round(6)
    array([[0.0625  , 0.      , 0.      , 0.      ],
           [0.287682, 0.      , 0.      , 0.      ]])
    """
    law = _HybridLaw(radii, power_law(2.0, relations))
    return sweep_pairs(_sweep, starts, ends, offsets, pairs, directions, law)
