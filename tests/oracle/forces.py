"""The constant-force histogram by its definition, one line and one section at a time.

    F^AB(θ) = ∫dv ∬ [u_a > u_b] du_a du_b

Between two neighbouring v at which a vertex lies or an edge of A crosses one of B, the inner
integral is a quadratic polynomial of v, so a few Gauss points integrate it exactly. Everything runs
in extended precision, so that what a comparison shows is the error of the kernel.
"""

import itertools

import numpy as np

REAL = np.longdouble
NODES, NODE_WEIGHTS = (x.astype(REAL) for x in np.polynomial.legendre.leggauss(3))


def force_histogram(a, b, directions):
    """Return the constant-force histogram of a on b, both lists of rings, shape (directions,)."""
    turns = 2 * REAL(np.pi) * np.arange(directions, dtype=REAL) / directions
    return np.array([float(force(a, b, turn)) for turn in turns])


def force(a, b, angle):
    edges_a, edges_b = edges(a, angle), edges(b, angle)
    breaks = sorted(
        {v for (_, v), (_, w) in edges_a + edges_b for v in (v, w)}
        | set(crossings(edges_a, edges_b))
    )
    total = REAL(0)
    for low, high in itertools.pairwise(breaks):
        middle, half = (low + high) / 2, (high - low) / 2
        for node, weight in zip(NODES, NODE_WEIGHTS, strict=True):
            v = middle + half * node
            total += half * weight * line_force(section(edges_a, v), section(edges_b, v))
    return total


def edges(rings, angle):
    """Return each edge as two points (u, v), u along the direction and v across it."""
    c, s = np.cos(angle), np.sin(angle)
    result = []
    for ring in rings:
        x, y = np.asarray(ring, dtype=REAL).T
        points = list(zip(x * c + y * s, y * c - x * s, strict=True))
        result += zip(points, points[1:] + points[:1], strict=True)
    return result


def crossings(edges_a, edges_b):
    """Yield the v at which an edge of A crosses an edge of B."""
    for (p, q), (r, s) in itertools.product(edges_a, edges_b):
        low = max(min(p[1], q[1]), min(r[1], s[1]))
        high = min(max(p[1], q[1]), max(r[1], s[1]))
        if low < high:
            at_low = position(p, q, low) - position(r, s, low)
            at_high = position(p, q, high) - position(r, s, high)
            if at_low * at_high < 0:
                yield low + (high - low) * at_low / (at_low - at_high)


def section(edges_, v):
    """Return the intervals of u that the line at v has inside the polygon."""
    # A vertex on the line belongs to the edge above it, so that crossings always come in twos.
    inside = sorted(position(p, q, v) for p, q in edges_ if (p[1] <= v) != (q[1] <= v))
    return list(zip(inside[::2], inside[1::2], strict=True))


def position(p, q, v):
    return p[0] + (q[0] - p[0]) * (v - p[1]) / (q[1] - p[1])


def line_force(section_a, section_b):
    """Return ∬ [u_a > u_b] du_a du_b over all pairs of intervals."""
    total = REAL(0)
    for (a0, a1), (b0, b1) in itertools.product(section_a, section_b):
        # The part of [b0, b1] below u_a is linear between these.
        stops = sorted({a0, a1, min(max(b0, a0), a1), min(max(b1, a0), a1)})
        for low, high in itertools.pairwise(stops):
            below = [min(max(u - b0, REAL(0)), b1 - b0) for u in (low, high)]
            total += (high - low) * (below[0] + below[1]) / 2
    return total
