"""The sweep that all exact histograms of forces share: every direction, every pair of objects.

For a direction θ let u run along it and v across it. With Ψ'' = φ, the force that two points at
distance d exert on each other, Ψ⁺(d) = Ψ(d) for d > 0 and 0 otherwise,

    F^AB(θ) = −Σ s_e s_e' ∫ Ψ⁺(u_e(v) − u_e'(v)) dv

over the edges e of A and e' of B that share some v; s is +1 where a line of growing u enters the
polygon through the edge and −1 where it leaves. A family of forces is a function that gives the
integral for two edges; u_e − u_e' is linear in v, so it is elementary. A sweep over edges sorted
by where they start in v meets exactly the pairs of edges that overlap; for simple shapes their
number is linear in the number of vertices.

References
----------
P. Matsakis, L. Wendling, "A new way to represent the relative position between areal objects",
IEEE TPAMI 21(7), 1999.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from sketchmatch.kernels._jit import kernel
from sketchmatch.kernels.projection import (
    EDGES,
    HIGH,
    LOW,
    SIGN,
    SLOPE,
    START,
    V_HIGH,
    V_LOW,
    Projection,
    Scratch,
    direction_cosines,
    empty_projection,
    measure_sections,
    project,
    separating_directions,
)
from sketchmatch.model.arrays import BoolArray, FloatArray, IntArray, frozen, settled_middle

__all__ = ["pair_sweep", "sum_over_edges", "sweep_pairs"]


def sweep_pairs(
    sweep: Callable[..., FloatArray],
    starts: FloatArray,
    ends: FloatArray,
    offsets: IntArray,
    pairs: IntArray,
    directions: int,
    law: Any,
) -> FloatArray:
    """Return the histograms of pairs of objects for one family of forces.

    Parameters
    ----------
    sweep
        The family's kernel, which calls what :func:`pair_sweep` made for it. It must be a function
        of a module: numba keeps no machine code of a closure that Python calls.
    starts, ends, offsets, pairs, directions
        As in :func:`~sketchmatch.kernels.constant_force.constant_force_histograms`.
    law
        What the family wants to know.

    Returns
    -------
    ndarray
        Shape (p, directions).

    Examples
    --------
    Constant forces between two unit squares, the second 4 further right:

    >>> from sketchmatch.kernels.constant_force import _sweep
    >>> corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> starts = np.concatenate([corners, corners + [4.0, 0.0]])
    >>> ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in (starts[:4], starts[4:])])
    >>> sweep_pairs(_sweep, starts, ends, np.array([0, 4, 8]), np.array([[1, 0]]), 4, None)
    array([[1., 0., 0., 0.]])
    """
    # Floats are finest about the origin. The middle is about that of all objects, so that a
    # histogram does not depend on which others are asked for, nor mostly on which others there are.
    middle = settled_middle(starts.min(axis=0), starts.max(axis=0))
    used = np.zeros(offsets.size - 1, dtype=np.bool_)
    used[pairs] = True
    # One type each, whoever gives them: the kernel is compiled once, by a warm-up, and not again by
    # the first request.
    offsets, pairs = frozen(offsets), frozen(pairs)
    starts, ends = (np.ascontiguousarray(points - middle) for points in (starts, ends))
    return sweep(empty_projection(offsets), starts, ends, used, pairs, directions, law)


def pair_sweep(pair_force: Callable[..., Any], sections: bool) -> Callable[..., FloatArray]:
    """Make the kernel that sweeps all pairs in all directions for one family of forces.

    Parameters
    ----------
    pair_force
        The kernel ``(projection, a, b, p, order, law) -> (forward, backward)`` that gives F^AB of
        pair p = (a, b) for a direction and for its opposite. ``order`` is 1 where a lies beyond b
        on every line that meets both, −1 where b lies beyond a, 0 where neither is known.
    sections
        Whether it needs the lengths of sections.

    Returns
    -------
    callable
        ``(room, starts, ends, used, pairs, directions, law) -> histograms``: room for a
        projection, the edges about the origin, which objects the pairs use, and the rest as in
        :func:`sweep_pairs`.

    Examples
    --------
    Constant forces of a unit square on one 4 further right:

    >>> from sketchmatch.kernels.constant_force import _pair_force
    >>> sweep = pair_sweep(_pair_force, sections=True)
    >>> corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> starts = np.concatenate([corners, corners + [4.0, 0.0]])
    >>> ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in (starts[:4], starts[4:])])
    >>> room, used = empty_projection(np.array([0, 4, 8])), np.array([True, True])
    >>> sweep(room, starts, ends, used, np.array([[0, 1]]), 4, None)
    array([[0., 0., 1., 0.]])
    """

    @kernel
    def compute(
        room: tuple[Projection, Scratch],
        starts: FloatArray,
        ends: FloatArray,
        used: BoolArray,
        pairs: IntArray,
        directions: int,
        law: Any,
    ) -> FloatArray:
        projection, scratch = room
        offsets, spans = projection.offsets, projection.spans
        half = directions // 2
        separating, orders = separating_directions(starts, offsets, used, pairs, directions)
        found = np.zeros((pairs.shape[0], directions))
        for direction in range(half):
            cosine, sine = direction_cosines(direction, directions)
            project(projection, scratch, starts, ends, used, cosine, sine)
            if sections:
                measure_sections(projection, used)
            for p in range(pairs.shape[0]):
                a, b = pairs[p, 0], pairs[p, 1]
                if spans[a, V_HIGH] <= spans[b, V_LOW] or spans[b, V_HIGH] <= spans[a, V_LOW]:
                    continue
                order = 0
                if separating[p] >= 0:
                    # Beyond a right angle the order turns; at one no line meets both.
                    acute = 4 * abs(direction - separating[p]) < directions
                    order = orders[p] if acute else -orders[p]
                forward, backward = pair_force(projection, a, b, p, order, law)
                found[p, direction] = forward
                found[p, direction + half] = backward
        return found

    return compute


def sum_over_edges(edge_force: Callable[..., Any]) -> Callable[..., tuple[float, float]]:
    """Make the kernel that sums a family's integral over all pairs of edges that share some v.

    Parameters
    ----------
    edge_force
        The kernel ``(a0, a1, b0, b1, law) -> (forward, backward)`` that gives
        ∫₀¹ Ψ⁺(a(t) − b(t)) dt and the same for b(t) − a(t), where a runs from a0 to a1 and b from
        b0 to b1.

    Returns
    -------
    callable
        ``(projection, a, b, law) -> (forward, backward)``.

    Examples
    --------
    Constant forces along x between two unit squares, the second 4 further right:

    >>> from sketchmatch.kernels.constant_force import _edge_force
    >>> add_up = sum_over_edges(_edge_force)
    >>> corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> starts = np.concatenate([corners, corners + [4.0, 0.0]])
    >>> ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in (starts[:4], starts[4:])])
    >>> room = empty_projection(np.array([0, 4, 8]))
    >>> project(*room, starts, ends, np.array([True, True]), 1.0, 0.0)
    >>> np.array(add_up(room[0], 1, 0, None)), np.array(add_up(room[0], 0, 1, None))
    (array([1., 0.]), array([0., 1.]))
    """

    @kernel
    def compute(projection: Projection, a: int, b: int, law: Any) -> tuple[float, float]:
        edges, spans, active = projection.edges, projection.spans, projection.active
        low, high = max(spans[a, V_LOW], spans[b, V_LOW]), min(spans[a, V_HIGH], spans[b, V_HIGH])
        i, j = projection.offsets[a], projection.offsets[b]
        end_a, end_b = i + projection.counts[a, EDGES], j + projection.counts[b, EDGES]
        count_a = count_b = 0
        forward = backward = 0.0
        while True:
            while i < end_a and edges[i, HIGH] <= low:
                i += 1
            while j < end_b and edges[j, HIGH] <= low:
                j += 1
            next_a = edges[i, LOW] if i < end_a else np.inf
            next_b = edges[j, LOW] if j < end_b else np.inf
            start = min(next_a, next_b)
            if start >= high:
                break
            from_a = next_a <= next_b
            side = 1 if from_a else 0
            kept = 0
            for m in range(count_b if from_a else count_a):
                other = active[side, m]
                if edges[other, HIGH] <= start:
                    continue
                active[side, kept] = other
                kept += 1
                ea, eb = (i, other) if from_a else (other, j)
                bottom = max(edges[ea, LOW], edges[eb, LOW])
                height = min(edges[ea, HIGH], edges[eb, HIGH]) - bottom
                a0 = edges[ea, START] + edges[ea, SLOPE] * (bottom - edges[ea, LOW])
                b0 = edges[eb, START] + edges[eb, SLOPE] * (bottom - edges[eb, LOW])
                a1, b1 = a0 + edges[ea, SLOPE] * height, b0 + edges[eb, SLOPE] * height
                plus, minus = edge_force(a0, a1, b0, b1, law)
                weight = -edges[ea, SIGN] * edges[eb, SIGN] * height
                forward += weight * plus
                backward += weight * minus
            if from_a:
                count_b = kept
                active[0, count_a] = i
                count_a += 1
                i += 1
            else:
                count_a = kept
                active[1, count_b] = j
                count_b += 1
                j += 1
        # Rounding may leave a trace below zero where there is no force at all.
        return max(forward, 0.0), max(backward, 0.0)

    return compute
