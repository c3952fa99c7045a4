"""Histograms of any force that is a power of the distance, or powers in parts, by definition.

    F^AB(θ) = ∫dv ∬ [u_a > u_b] φ(u_a − u_b) du_a du_b = ∫dv ∫ φ(d) C_v(d) dd,  d > 0

C_v(d) is how much of A's section at v comes to lie on B's when it is moved back by d: for two
intervals it rises, stays and falls along straight lines. So every term of these sums is positive
and nothing cancels, however small and far apart the objects are. Where φ or C bends in v a new
piece begins; the double exponential rule does not mind what happens at the ends of a piece.

A law is a list of (from, to, r, factor): φ(d) = factor·d^(−r) for from < d ≤ to.
"""

import itertools
import math

import numpy as np
import shapely

from tests.oracle.forces import REAL, edges

WHOLE = REAL(math.inf)
GAUSS, GAUSS_WEIGHTS = (x.astype(REAL) for x in np.polynomial.legendre.leggauss(12))
FIRST_STEP, REACH, HALVINGS = REAL(0.2), 3.6, 7
NOISE = REAL(1e-16)  # a rounding of coordinates or some, as a share of the largest


def force(r):
    return [(REAL(0), WHOLE, REAL(r), REAL(1))]


def hybrid(a, b, near=0.01, overlap=3.0):
    """Return F02's law: constant up to a share of the smaller object, or of the common part."""
    first, second = (shapely.Polygon(rings[0], rings[1:]) for rings in (a, b))
    common = first.intersection(second).area
    reach = REAL(max(near * diameter(min(first.area, second.area)), overlap * diameter(common)))
    return [(REAL(0), reach, REAL(0), 1 / reach**2), (reach, WHOLE, REAL(2), REAL(1))]


def diameter(area):
    return 2 * math.sqrt(area / math.pi)


def facing_force(a, b, r):
    """Return the force between compact objects of these areas that face each other so far apart.

    Where two objects only graze each other, their histogram is a rounding of their coordinates;
    it is then compared with this.
    """
    first, second = (shapely.Polygon(rings[0], rings[1:]) for rings in (a, b))
    one, other = math.sqrt(first.area), math.sqrt(second.area)
    distance = max(first.centroid.distance(second.centroid), (one + other) / 2)
    return one**2 * other**2 / (one + other) * distance**-r


def law_histogram(a, b, law, directions):
    """Return the histogram of a on b, both lists of rings, shape (directions,); inf if infinite."""
    pieces = []
    for k in range(directions):
        angle = 2 * PI * k / directions
        pieces += [(k, *piece) for piece in joint_sections(edges(a, angle), edges(b, angle), law)]
    result = np.zeros(directions, dtype=REAL)
    if pieces:
        which, widths, low, high = (np.array(column) for column in zip(*pieces, strict=True))
        np.add.at(result, which, integrals(widths, low, high, law))
    return result.astype(float)


def joint_sections(edges_a, edges_b, law):
    """Yield (width, low, high) of each piece of v and pair of intervals, one of A and one of B.

    ``low`` and ``high`` are the distances between the intervals' ends at the two ends of the piece:
    (a0 − b1, a0 − b0, a1 − b1, a1 − b0).
    """
    extent = max(abs(x) for edge in edges_a + edges_b for point in edge for x in point)
    extent = max(extent, REAL(1e-300))
    ends_a, ends_b = np.array(edges_a), np.array(edges_b)
    bends = [ends[..., 1].ravel() for ends in (ends_a, ends_b)]
    bends += [meetings(ends_a, ends_b, bound) for bound, *_ in law]
    breaks = np.unique(np.concatenate(bends))
    breaks = breaks[np.diff(breaks, append=WHOLE) > 4e-18 * extent]
    bottoms, tops = breaks[:-1], breaks[1:]
    for width, bottom, top, section_a, section_b in zip(
        tops - bottoms,
        bottoms,
        tops,
        sections(ends_a, bottoms, tops),
        sections(ends_b, bottoms, tops),
        strict=True,
    ):
        for a0, a1 in section_a:
            for b0, b1 in section_b:
                pairs = [(a0, b1), (a0, b0), (a1, b1), (a1, b0)]
                low, high = (
                    np.array([between(ends_a[i], ends_b[j], v) for i, j in pairs])
                    for v in (bottom, top)
                )
                low, high = without_noise(low, high, extent)
                shortest = np.maximum(low[1:3] - low[0], high[1:3] - high[0]).min()
                if max(low[3], high[3]) > 0 and shortest > NOISE * extent:
                    yield width, low, high


def meetings(ends_a, ends_b, distance):
    """Return the v at which an edge of A lies ``distance`` beyond one of B."""
    low_a, high_a = (np.sort(ends_a[..., 1], axis=1)[:, k] for k in (0, 1))
    low_b, high_b = (np.sort(ends_b[..., 1], axis=1)[:, k] for k in (0, 1))
    low = np.maximum(low_a[:, None], low_b[None, :])
    high = np.minimum(high_a[:, None], high_b[None, :])
    i, j = np.nonzero(low < high)
    low, high = low[i, j], high[i, j]
    at_low, at_high = (between(ends_a[i], ends_b[j], v) - distance for v in (low, high))
    meet = at_low * at_high < 0
    share = at_low[meet] / (at_low[meet] - at_high[meet])
    return low[meet] + (high[meet] - low[meet]) * share


def between(edge_a, edge_b, v):
    """Return how far the first edge lies beyond the second at v."""
    return place(edge_a, v) - place(edge_b, v)


def place(edge, v):
    (u0, v0), (u1, v1) = np.moveaxis(edge[..., 0, :], -1, 0), np.moveaxis(edge[..., 1, :], -1, 0)
    return u0 + (u1 - u0) * ((v - v0) / (v1 - v0))


def sections(ends, bottoms, tops):
    """Return for each piece of v the polygon's intervals, as pairs of edges by number."""
    result = []
    for middle in (bottoms + tops) / 2:
        inside = np.flatnonzero((ends[:, 0, 1] <= middle) != (ends[:, 1, 1] <= middle))
        inside = inside[np.argsort(place(ends[inside], middle))]
        result.append(list(zip(inside[::2], inside[1::2], strict=True)))
    return result


def without_noise(low, high, extent):
    """Make rounded zeros zeros: no distance changes its sign within a piece."""
    for ends in (low, high):
        ends[np.abs(ends) < NOISE * extent] = 0
    turns = low * high < 0
    smaller = np.abs(low) < np.abs(high)
    low[turns & smaller] = 0
    high[turns & ~smaller] = 0
    return low, high


def integrals(widths, low, high, law):
    """Integrate over each piece by the double exponential rule, halving the step as it takes."""
    step = FIRST_STEP
    totals = widths * step * rule(low, high, law, np.arange(-REACH, REACH + 0.1, float(step)))
    open_ = np.arange(len(totals))
    for _ in range(HALVINGS):
        between_ = np.arange(-REACH, REACH, float(step)) + float(step) / 2
        step = step / 2
        sums = rule(low[open_], high[open_], law, between_)
        finer = totals[open_] / 2 + widths[open_] * step * sums
        with np.errstate(invalid="ignore"):  # where it is infinite
            change = np.abs(finer - totals[open_])
        totals[open_] = finer
        # The number of true digits doubles with each halving; noise as wide as a rounding does not.
        open_ = open_[change > np.maximum(1e-9 * finer, 1e-17 * totals.max())]
        if not len(open_):
            break
    assert not len(open_), "an integral does not settle"
    return totals


def rule(low, high, law, steps):
    """Return Σ weight·value over the points of the double exponential rule on [0, 1]."""
    bend = REAL(math.pi) * np.sinh(steps.astype(REAL))
    share, rest = 1 / (1 + np.exp(-bend)), 1 / (1 + np.exp(bend))
    weights = REAL(math.pi) * np.cosh(steps.astype(REAL)) * share * rest
    distances = low.T[:, :, None] * rest + high.T[:, :, None] * share
    return line_force(distances, law) @ weights


def line_force(distances, law):
    """Return ∫ φ(d) C(d) dd, d > 0, for intervals whose ends lie (a0−b1, a0−b0, a1−b1, a1−b0)."""
    first, inner, outer, last = distances
    knots = [first, np.minimum(inner, outer), np.maximum(inner, outer), last]
    most = knots[1] - first
    total = np.zeros_like(first)
    for begin, end in itertools.pairwise(knots):
        for from_, to, r, factor in law:
            p, q = (np.clip(knot, from_, to) for knot in (begin, end))
            there = q > p
            if not there.any():
                continue
            p, q = p[there], q[there]
            common = [
                np.clip(np.minimum(d - first[there], last[there] - d), 0, most[there])
                for d in (p, q)
            ]
            for share, moment in zip(common, moments(p, q, r), strict=True):
                total[there] += factor * share * np.where(share > 0, moment, 0)
    return total


def moments(p, q, r):
    """Return ∫ d^(−r) (q−d)/(q−p) dd and ∫ d^(−r) (d−p)/(q−p) dd from p to q, 0 ≤ p < q."""
    falling, rising = np.full_like(p, WHOLE), np.full_like(p, WHOLE)
    zero = p == 0
    if r < 2:
        rising[zero] = q[zero] ** (1 - r) / (2 - r)
    if r < 1:
        falling[zero] = q[zero] ** (1 - r) / ((1 - r) * (2 - r))
    wide = ~zero & (q > 1.25 * p)
    if wide.any():
        low, high = p[wide], q[wide]
        zeroth, first = powers(low, high, 1 - r), powers(low, high, 2 - r)
        falling[wide] = (high * zeroth - first) / (high - low)
        rising[wide] = (first - low * zeroth) / (high - low)
    thin = ~zero & ~wide
    if thin.any():
        low, length = p[thin, None], (q - p)[thin, None]
        share = (1 + GAUSS) / 2
        terms = GAUSS_WEIGHTS / 2 * (low + length * share) ** (-r)
        falling[thin] = (terms * (1 - share)).sum(axis=1) * length[:, 0]
        rising[thin] = (terms * share).sum(axis=1) * length[:, 0]
    return falling, rising


def powers(low, high, k):
    """Return ∫ d^(k−1) dd from low to high, for k about 0 as well."""
    span = np.log1p((high - low) / low)
    if k == 0:
        return span
    return low**k * np.expm1(k * span) / k


PI = 4 * np.arctan(REAL(1))
