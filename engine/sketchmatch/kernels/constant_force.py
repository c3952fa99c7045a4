"""Exact constant-force histograms (r = 0) of polygons.

Where all of A lies beyond all of B the force is ∫ length_A(v)·length_B(v) dv. It is computed as
such: each object's section lengths are taken once for a direction and serve all its pairs, and no
digits are lost to cancellation however far apart the objects are. Where neither lies beyond the
other, Ψ(d) = d²/2 is summed over pairs of edges.
"""

from __future__ import annotations

from sketchmatch.kernels._jit import kernel
from sketchmatch.kernels.projection import BREAK, FIRST, LAST, SEGMENTS, Projection, Scratch
from sketchmatch.kernels.sweep import pair_sweep, sum_over_edges, sweep_pairs
from sketchmatch.model.arrays import BoolArray, FloatArray, IntArray

__all__ = ["constant_force_histograms"]


@kernel
def _half_square_integral(d0: float, d1: float) -> float:
    """Return ∫₀¹ max(d(t), 0)² / 2 dt for linear d."""
    if d0 >= 0.0 and d1 >= 0.0:
        return (d0 * d0 + d0 * d1 + d1 * d1) / 6.0
    if d0 <= 0.0 and d1 <= 0.0:
        return 0.0
    peak = max(d0, d1)
    return peak * peak * peak / (6.0 * abs(d0 - d1))


@kernel
def _edge_force(a0: float, a1: float, b0: float, b1: float, _law: None) -> tuple[float, float]:
    d0, d1 = a0 - b0, a1 - b1
    return _half_square_integral(d0, d1), _half_square_integral(-d0, -d1)


_sum_over_edges = sum_over_edges(_edge_force)


@kernel
def _product_of_sections(projection: Projection, a: int, b: int) -> float:
    """Return ∫ length_A(v)·length_B(v) dv."""
    segments = projection.segments
    i, j = projection.offsets[a] + a, projection.offsets[b] + b
    end_a, end_b = i + projection.counts[a, SEGMENTS], j + projection.counts[b, SEGMENTS]
    low = max(segments[i, BREAK], segments[j, BREAK])
    high = min(segments[end_a, BREAK], segments[end_b, BREAK])
    i, j = _segment(segments, i, end_a, low), _segment(segments, j, end_b, low)
    total = 0.0
    while low < high:
        end_i, end_j = segments[i + 1, BREAK], segments[j + 1, BREAK]
        top = min(end_i, end_j)
        p0, p1 = _lengths(segments, i, low, top)
        q0, q1 = _lengths(segments, j, low, top)
        total += (top - low) * (2.0 * p0 * q0 + p0 * q1 + p1 * q0 + 2.0 * p1 * q1)
        if end_i <= top:
            i += 1
        if end_j <= top:
            j += 1
        low = top
    return total / 6.0


@kernel
def _segment(segments: FloatArray, first: int, end: int, v: float) -> int:
    """Return the last segment of first … end − 1 that begins at v or below."""
    while end - first > 1:
        middle = (first + end) // 2
        if segments[middle, BREAK] <= v:
            first = middle
        else:
            end = middle
    return first


@kernel
def _lengths(segments: FloatArray, row: int, low: float, top: float) -> tuple[float, float]:
    """Return the section's length at two v within one segment."""
    start, first = segments[row, BREAK], segments[row, FIRST]
    rise = (segments[row, LAST] - first) / (segments[row + 1, BREAK] - start)
    return first + rise * (low - start), first + rise * (top - start)


@kernel
def _pair_force(
    projection: Projection, a: int, b: int, _p: int, order: int, law: None
) -> tuple[float, float]:
    if order > 0:
        return _product_of_sections(projection, a, b), 0.0
    if order < 0:
        return 0.0, _product_of_sections(projection, a, b)
    return _sum_over_edges(projection, a, b, law)


_compute = pair_sweep(_pair_force, sections=True)


@kernel
def _sweep(
    room: tuple[Projection, Scratch],
    starts: FloatArray,
    ends: FloatArray,
    used: BoolArray,
    pairs: IntArray,
    directions: int,
    law: None,
) -> FloatArray:
    return _compute(room, starts, ends, used, pairs, directions, law)


def constant_force_histograms(
    starts: FloatArray,
    ends: FloatArray,
    offsets: IntArray,
    pairs: IntArray,
    directions: int,
) -> FloatArray:
    """Return the constant-force histograms of pairs of objects.

    Parameters
    ----------
    starts, ends
        Shape (e, 2): the edges of all objects, outer rings counter-clockwise, holes clockwise.
        The edges of an object may come in any order; those of a ring in a row are sorted fastest.
    offsets
        Shape (objects + 1,): object k owns the edges offsets[k] … offsets[k+1].
    pairs
        Shape (p, 2): the objects (a, b) of each pair.
    directions
        n, even; direction k is 2πk/n from +x.

    Returns
    -------
    ndarray
        Shape (p, n), in units of length to the third power.

    Examples
    --------
    A unit square and another one 4 further right: each line along x meets both in a length of 1,
    over a height of 1.

    >>> import numpy as np
    >>> corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> starts = np.concatenate([corners, corners + [4.0, 0.0]])
    >>> ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in (starts[:4], starts[4:])])
    >>> offsets, pairs = np.array([0, 4, 8]), np.array([[1, 0], [0, 1]])
    >>> constant_force_histograms(starts, ends, offsets, pairs, 4)
    array([[1., 0., 0., 0.],
           [0., 0., 1., 0.]])
    """
    return sweep_pairs(_sweep, starts, ends, offsets, pairs, directions, None)
