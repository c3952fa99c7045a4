"""Exact constant-force histograms (r = 0) of polygons, by sweeping a line over their edges.

For a direction θ let u run along it and v across it. With Ψ⁺(d) = d²/2 for d > 0 and 0 otherwise,

    F^AB(θ) = −Σ s_e s_e' ∫ Ψ⁺(u_e(v) − u_e'(v)) dv

over the edges e of A and e' of B that share some v; s is +1 where a line of growing u enters the
polygon through the edge and −1 where it leaves. Every integral is elementary because u_e − u_e'
is linear in v. Where all of A lies beyond all of B the sum
collapses to ∫ length_A(v)·length_B(v) dv, which is computed as such: it loses no digits to
cancellation however far apart the objects are.

Both kernels take edges sorted by where they start in v, so a sweep meets exactly the pairs of
edges that overlap; for simple shapes their number is linear in the number of vertices.

References
----------
P. Matsakis, L. Wendling, "A new way to represent the relative position between areal objects",
IEEE TPAMI 21(7), 1999.
"""

from __future__ import annotations

import numpy as np

from sketchmatch.kernels._jit import kernel
from sketchmatch.model.arrays import FloatArray, IntArray

__all__ = ["constant_force_histograms"]

# Columns of a projected edge.
_LOW, _HIGH, _START, _SLOPE, _SIGN = 0, 1, 2, 3, 4


@kernel
def constant_force_histograms(
    starts: FloatArray,
    ends: FloatArray,
    offsets: IntArray,
    pairs: IntArray,
    directions: int,
) -> FloatArray:
    """Return the constant-force histograms of pairs of polygons.

    Parameters
    ----------
    starts, ends
        Shape (e, 2): the edges of all polygons, outer rings counter-clockwise, holes clockwise.
    offsets
        Shape (objects + 1,): polygon k owns the edges offsets[k] … offsets[k+1].
    pairs
        Shape (p, 2): the polygons (a, b) of each pair.
    directions
        n, even; direction k is 2πk/n from +x.

    Returns
    -------
    ndarray
        Shape (p, n), in units of length to the third power.
    """
    objects = offsets.size - 1
    half = directions // 2
    centre_x, centre_y = starts[0, 0], starts[0, 1]
    edges = np.empty((starts.shape[0], 5))
    counts = np.empty(objects, dtype=np.int64)
    spans = np.empty((objects, 2))
    longest = 0
    for k in range(objects):
        longest = max(longest, offsets[k + 1] - offsets[k])
    active_a = np.empty(longest, dtype=np.int64)
    active_b = np.empty(longest, dtype=np.int64)
    histograms = np.zeros((pairs.shape[0], directions))
    for direction in range(half):
        angle = 2.0 * np.pi * direction / directions
        cosine, sine = np.cos(angle), np.sin(angle)
        for k in range(objects):
            first, last = offsets[k], offsets[k + 1]
            counts[k] = _project(
                starts[first:last],
                ends[first:last],
                centre_x,
                centre_y,
                cosine,
                sine,
                edges[first:last],
                spans[k],
            )
        for p in range(pairs.shape[0]):
            a, b = pairs[p, 0], pairs[p, 1]
            forward, backward = _forces(
                edges[offsets[a] : offsets[a] + counts[a]],
                edges[offsets[b] : offsets[b] + counts[b]],
                spans[a],
                spans[b],
                active_a,
                active_b,
            )
            histograms[p, direction] = forward
            histograms[p, direction + half] = backward
    return histograms


@kernel
def _project(
    starts: FloatArray,
    ends: FloatArray,
    centre_x: float,
    centre_y: float,
    cosine: float,
    sine: float,
    edges: FloatArray,
    span: FloatArray,
) -> int:
    """Write edges as seen along a direction, sorted by their start in v; return their number."""
    count = 0
    span[0], span[1] = np.inf, -np.inf
    for k in range(starts.shape[0]):
        x0, y0 = starts[k, 0] - centre_x, starts[k, 1] - centre_y
        x1, y1 = ends[k, 0] - centre_x, ends[k, 1] - centre_y
        u0, v0 = x0 * cosine + y0 * sine, y0 * cosine - x0 * sine
        u1, v1 = x1 * cosine + y1 * sine, y1 * cosine - x1 * sine
        span[0], span[1] = min(span[0], u0), max(span[1], u0)
        if v0 == v1:
            continue
        sign = -1.0
        if v0 > v1:
            u0, v0, u1, v1 = u1, v1, u0, v0
            sign = 1.0
        place = count
        while place > 0 and edges[place - 1, _LOW] > v0:
            for column in range(5):
                edges[place, column] = edges[place - 1, column]
            place -= 1
        edges[place, _LOW], edges[place, _HIGH] = v0, v1
        edges[place, _START], edges[place, _SLOPE] = u0, (u1 - u0) / (v1 - v0)
        edges[place, _SIGN] = sign
        count += 1
    return count


@kernel
def _forces(
    edges_a: FloatArray,
    edges_b: FloatArray,
    span_a: FloatArray,
    span_b: FloatArray,
    active_a: IntArray,
    active_b: IntArray,
) -> tuple[float, float]:
    """Return F^AB for one direction and for its opposite."""
    order = 0
    if span_a[0] >= span_b[1]:
        order = 1
    elif span_b[0] >= span_a[1]:
        order = -1
    centre_a, centre_b = 0.5 * (span_a[0] + span_a[1]), 0.5 * (span_b[0] + span_b[1])
    forward = backward = 0.0
    count_a = count_b = 0
    i = j = 0
    while i < edges_a.shape[0] or j < edges_b.shape[0]:
        if i == edges_a.shape[0] and count_a == 0:
            break
        if j == edges_b.shape[0] and count_b == 0:
            break
        from_a = j == edges_b.shape[0] or (
            i < edges_a.shape[0] and edges_a[i, _LOW] <= edges_b[j, _LOW]
        )
        if from_a:
            edge = edges_a[i]
            kept = 0
            for m in range(count_b):
                other = edges_b[active_b[m]]
                if other[_HIGH] > edge[_LOW]:
                    active_b[kept] = active_b[m]
                    kept += 1
                    plus, minus = _term(edge, other, order, centre_a, centre_b)
                    forward += plus
                    backward += minus
            count_b = kept
            active_a[count_a] = i
            count_a += 1
            i += 1
        else:
            edge = edges_b[j]
            kept = 0
            for m in range(count_a):
                other = edges_a[active_a[m]]
                if other[_HIGH] > edge[_LOW]:
                    active_a[kept] = active_a[m]
                    kept += 1
                    plus, minus = _term(other, edge, order, centre_a, centre_b)
                    forward += plus
                    backward += minus
            count_a = kept
            active_b[count_b] = j
            count_b += 1
            j += 1
    # Rounding may leave a trace below zero where there is no force at all.
    return max(forward, 0.0), max(backward, 0.0)


@kernel
def _term(
    edge_a: FloatArray, edge_b: FloatArray, order: int, centre_a: float, centre_b: float
) -> tuple[float, float]:
    """Return what one pair of overlapping edges adds to the force in a direction and its dual."""
    low = max(edge_a[_LOW], edge_b[_LOW])
    high = min(edge_a[_HIGH], edge_b[_HIGH])
    height = high - low
    a0 = edge_a[_START] + edge_a[_SLOPE] * (low - edge_a[_LOW])
    b0 = edge_b[_START] + edge_b[_SLOPE] * (low - edge_b[_LOW])
    a1 = a0 + edge_a[_SLOPE] * height
    b1 = b0 + edge_b[_SLOPE] * height
    sign = edge_a[_SIGN] * edge_b[_SIGN]
    if order != 0:
        product = _product_integral(a0 - centre_a, a1 - centre_a, b0 - centre_b, b1 - centre_b)
        value = sign * height * product
        return (value, 0.0) if order > 0 else (0.0, value)
    d0, d1 = a0 - b0, a1 - b1
    plus = -sign * height * _half_square_integral(d0, d1)
    minus = -sign * height * _half_square_integral(-d0, -d1)
    return plus, minus


@kernel
def _product_integral(p0: float, p1: float, q0: float, q1: float) -> float:
    """Return ∫₀¹ p(t) q(t) dt for linear p and q."""
    return (2.0 * p0 * q0 + p0 * q1 + p1 * q0 + 2.0 * p1 * q1) / 6.0


@kernel
def _half_square_integral(d0: float, d1: float) -> float:
    """Return ∫₀¹ max(d(t), 0)² / 2 dt for linear d."""
    if d0 >= 0.0 and d1 >= 0.0:
        return (d0 * d0 + d0 * d1 + d1 * d1) / 6.0
    if d0 <= 0.0 and d1 <= 0.0:
        return 0.0
    peak = max(d0, d1)
    return peak * peak * peak / (6.0 * abs(d0 - d1))
