"""Polygons as they are seen along a direction: sorted edges, spans and section lengths.

For a direction θ let u run along it and v across it. Histograms of forces need, for every line of
constant v, where it enters and leaves the objects. An edge that is not parallel to the direction
gives u as a linear function of v; edges sorted by where they start in v let a sweep meet exactly
the edges of two objects that share some v.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sketchmatch.kernels._jit import kernel
from sketchmatch.model.arrays import BoolArray, FloatArray, IntArray

__all__ = [
    "BREAK",
    "EDGES",
    "FIRST",
    "HIGH",
    "LAST",
    "LOW",
    "SEGMENTS",
    "SIGN",
    "SLOPE",
    "START",
    "U_HIGH",
    "U_LOW",
    "V_HIGH",
    "V_LOW",
    "Projection",
    "Scratch",
    "direction_cosines",
    "empty_projection",
    "measure_sections",
    "project",
    "separating_directions",
]

# Columns of a projected edge: the v at which it starts and ends, u at its start, du/dv, and +1
# where a line of growing u enters the object through it, −1 where it leaves.
LOW, HIGH, START, SLOPE, SIGN = 0, 1, 2, 3, 4
# Columns of a segment, within which the length of a section is linear in v: the v at which it
# begins and the lengths at its two ends. It ends where the next row begins.
BREAK, FIRST, LAST = 0, 1, 2
# Columns of an object's spans, and of its counts.
U_LOW, U_HIGH, V_LOW, V_HIGH = 0, 1, 2, 3
EDGES, SEGMENTS = 0, 1


class Projection(NamedTuple):
    """Objects as they are seen along one direction.

    Attributes
    ----------
    offsets
        Shape (objects + 1,): object k owns the edges offsets[k] … offsets[k+1], and the segments
        from offsets[k] + k.
    edges
        Shape (e, 5): of object k the first ``counts[k, EDGES]`` rows, sorted by LOW.
    segments
        Shape (e + objects, 3): of object k the first ``counts[k, SEGMENTS]`` rows, and one more
        that only ends the last.
    counts
        Shape (objects, 2).
    spans
        Shape (objects, 4).
    active
        Scratch for sweeps, shape (2, most edges of an object).
    """

    offsets: IntArray
    edges: FloatArray
    segments: FloatArray
    counts: IntArray
    spans: FloatArray
    active: IntArray


class Scratch(NamedTuple):
    """What sorting the edges of one object needs.

    Attributes
    ----------
    edges
        Shape (most edges of an object, 5), unsorted.
    places
        Shape (2, most edges of an object): the sort writes from one row into the other.
    runs
        Shape (most edges of an object + 1,).
    """

    edges: FloatArray
    places: IntArray
    runs: IntArray


@kernel
def direction_cosines(direction: int, directions: int) -> tuple[float, float]:
    """Return cosine and sine of direction k of n, exact along the axes.

    Edges along an axis are common, and nothing but exactness tells that they meet no line.

    Parameters
    ----------
    direction, directions
        k and n, n > 0.

    Examples
    --------
    >>> direction_cosines(1, 4), direction_cosines(2, 4)
    ((-0.0, 1.0), (-1.0, -0.0))
    >>> [round(float(part), 6) for part in direction_cosines(1, 12)]
    [0.866025, 0.5]
    """
    quarter, rest = divmod(4 * direction, directions)
    angle = 0.5 * np.pi * rest / directions
    cosine, sine = (np.cos(angle), np.sin(angle)) if rest else (1.0, 0.0)
    for _ in range(quarter % 4):
        cosine, sine = -sine, cosine
    return cosine, sine


def empty_projection(offsets: IntArray) -> tuple[Projection, Scratch]:
    """Return room for the projection of objects with these offsets, and to sort their edges.

    Parameters
    ----------
    offsets
        Shape (objects + 1,): object k owns the edges offsets[k] … offsets[k+1].

    Examples
    --------
    A triangle and a square:

    >>> projection, scratch = empty_projection(np.array([0, 3, 7]))
    >>> projection.edges.shape, projection.segments.shape, scratch.edges.shape
    ((7, 5), (9, 3), (4, 5))
    """
    objects = offsets.size - 1
    edges = int(offsets[objects])
    longest = int(np.diff(offsets).max())
    projection = Projection(
        offsets,
        np.empty((edges, 5)),
        np.empty((edges + objects, 3)),
        np.zeros((objects, 2), dtype=np.int64),
        np.zeros((objects, 4)),
        np.empty((2, longest), dtype=np.int64),
    )
    scratch = Scratch(
        np.empty((longest, 5)),
        np.empty((2, longest), dtype=np.int64),
        np.empty(longest + 1, dtype=np.int64),
    )
    return projection, scratch


@kernel
def project(
    projection: Projection,
    scratch: Scratch,
    starts: FloatArray,
    ends: FloatArray,
    used: BoolArray,
    cosine: float,
    sine: float,
) -> None:
    """Project objects along a direction.

    Parameters
    ----------
    projection, scratch
        Room of :func:`empty_projection`; edges, counts and spans are written.
    starts, ends
        Shape (e, 2): edges of all objects, outer rings counter-clockwise, holes clockwise.
    used
        Shape (objects,): which objects to project.
    cosine, sine
        Of the direction.

    Examples
    --------
    Along x a line that grows enters a triangle through its left edge, which leans to the right,
    and leaves through the upright one; the one at the bottom meets no line.

    >>> corners = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]])
    >>> room = empty_projection(np.array([0, 3]))
    >>> project(*room, corners, np.roll(corners, -1, axis=0), np.array([True]), 1.0, 0.0)
    >>> int(room[0].counts[0, EDGES]), room[0].spans.tolist()
    (2, [[0.0, 2.0, 0.0, 1.0]])
    >>> room[0].edges[:2]
    array([[ 0.,  1.,  2.,  0., -1.],
           [ 0.,  1.,  0.,  2.,  1.]])
    """
    offsets, edges, spans = projection.offsets, projection.edges, projection.spans
    raw, places = scratch.edges, scratch.places
    for k in range(used.size):
        if not used[k]:
            continue
        count = 0
        u_low = v_low = np.inf
        u_high = v_high = -np.inf
        for e in range(offsets[k], offsets[k + 1]):
            x0, y0, x1, y1 = starts[e, 0], starts[e, 1], ends[e, 0], ends[e, 1]
            u0, v0 = x0 * cosine + y0 * sine, y0 * cosine - x0 * sine
            u1, v1 = x1 * cosine + y1 * sine, y1 * cosine - x1 * sine
            u_low, u_high = min(u_low, u0), max(u_high, u0)
            v_low, v_high = min(v_low, v0), max(v_high, v0)
            if v0 < v1:
                raw[count, LOW], raw[count, HIGH], raw[count, START] = v0, v1, u0
                raw[count, SIGN] = -1.0
            elif v1 < v0:
                raw[count, LOW], raw[count, HIGH], raw[count, START] = v1, v0, u1
                raw[count, SIGN] = 1.0
            else:
                continue
            raw[count, SLOPE] = (u1 - u0) / (v1 - v0)
            count += 1
        spans[k, U_LOW], spans[k, U_HIGH] = u_low, u_high
        spans[k, V_LOW], spans[k, V_HIGH] = v_low, v_high
        projection.counts[k, EDGES] = count
        row = _sort(raw, projection.counts[k, EDGES], places, scratch.runs)
        for place in range(count):
            for column in range(5):
                edges[offsets[k] + place, column] = raw[places[row, place], column]


@kernel
def _sort(edges: FloatArray, count: int, places: IntArray, runs: IntArray) -> int:
    """Write the places of ``count`` edges by rising LOW into one of two rows; return which.

    A natural merge sort: the edges of an outline come in chains that rise or fall in v, and there
    are few of them unless the outline is jagged.
    """
    found = _find_runs(edges, count, places, runs)
    source = 0
    while found > 1:
        target = 1 - source
        merged = 0
        for run in range(0, found, 2):
            left, end = runs[run], runs[min(run + 2, found)]
            middle = right = runs[run + 1]
            runs[merged] = left
            merged += 1
            for place in range(left, end):
                from_left = right == end
                if left < middle and right < end:
                    first, second = places[source, left], places[source, right]
                    from_left = edges[first, LOW] <= edges[second, LOW]
                if from_left:
                    places[target, place] = places[source, left]
                    left += 1
                else:
                    places[target, place] = places[source, right]
                    right += 1
        runs[merged] = count
        found = merged
        source = target
    return source


@kernel
def _find_runs(edges: FloatArray, count: int, places: IntArray, runs: IntArray) -> int:
    """Write the places of edges into the first row, so that they rise within runs.

    ``runs`` gets the start of each run, and the end of the last; their number is returned.
    """
    found = i = 0
    while i < count:
        j = i + 1
        if j < count and edges[j, LOW] < edges[i, LOW]:
            while j < count and edges[j, LOW] < edges[j - 1, LOW]:
                j += 1
            for k in range(i, j):
                places[0, k] = i + j - 1 - k
        else:
            while j < count and edges[j, LOW] >= edges[j - 1, LOW]:
                j += 1
            for k in range(i, j):
                places[0, k] = k
        runs[found] = i
        found += 1
        i = j
    runs[found] = count
    return found


@kernel
def measure_sections(projection: Projection, used: BoolArray) -> None:
    """Take the length of each projected object's section with a line as a function of its v.

    Parameters
    ----------
    projection
        After :func:`project`; segments and their counts are written.
    used
        Shape (objects,): which objects were projected.

    Examples
    --------
    Sections of a triangle along x are 2 long at the bottom, where v = 0, and 0 at the top:

    >>> corners = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]])
    >>> room, used = empty_projection(np.array([0, 3])), np.array([True])
    >>> project(*room, corners, np.roll(corners, -1, axis=0), used, 1.0, 0.0)
    >>> measure_sections(room[0], used)
    >>> room[0].segments[0], float(room[0].segments[1, BREAK])
    (array([0., 2., 0.]), 1.0)
    """
    edges, segments, active = projection.edges, projection.segments, projection.active
    for k in range(used.size):
        if not used[k]:
            continue
        begin, count = projection.offsets[k], projection.counts[k, EDGES]
        centre = 0.5 * (projection.spans[k, U_LOW] + projection.spans[k, U_HIGH])
        row = begin + k
        alive = taken = 0
        v = edges[begin, LOW]
        while taken < count or alive > 0:
            while taken < count and edges[begin + taken, LOW] <= v:
                active[0, alive] = begin + taken
                alive += 1
                taken += 1
            top = edges[begin + taken, LOW] if taken < count else np.inf
            for m in range(alive):
                top = min(top, edges[active[0, m], HIGH])
            first = last = 0.0
            kept = 0
            for m in range(alive):
                e = active[0, m]
                start, slope = edges[e, START] - centre, edges[e, SLOPE]
                first -= edges[e, SIGN] * (start + slope * (v - edges[e, LOW]))
                last -= edges[e, SIGN] * (start + slope * (top - edges[e, LOW]))
                if edges[e, HIGH] > top:
                    active[0, kept] = e
                    kept += 1
            alive = kept
            segments[row, BREAK] = v
            segments[row, FIRST], segments[row, LAST] = max(first, 0.0), max(last, 0.0)
            row += 1
            v = top
        segments[row, BREAK] = v
        projection.counts[k, SEGMENTS] = row - begin - k


@kernel
def separating_directions(
    starts: FloatArray,
    offsets: IntArray,
    used: BoolArray,
    pairs: IntArray,
    directions: int,
) -> tuple[IntArray, IntArray]:
    """Find for each pair of objects a direction along which they lie one after the other.

    Two objects with such a direction follow each other in the same order on every line of any
    direction that meets both.

    Parameters
    ----------
    starts
        Shape (e, 2): where the edges of all objects start.
    offsets, pairs
        Shapes (objects + 1,) and (p, 2), as in
        :func:`~sketchmatch.kernels.constant_force.constant_force_histograms`.
    used
        Shape (objects,): which objects the pairs have.
    directions
        n, even.

    Returns
    -------
    separating
        Shape (p,): the direction of the widest gap, from 0 to directions / 2 − 1, or −1 where no
        direction has a gap of at least 0.
    orders
        Shape (p,): 1 if the first object lies further along that direction, −1 if the second.

    Examples
    --------
    Of three squares the second lies above the first, and the third half within both:

    >>> square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> starts = np.concatenate([square, square + [0.0, 2.0], 3.0 * square])
    >>> offsets, used = np.array([0, 4, 8, 12]), np.array([True] * 3)
    >>> separating_directions(starts, offsets, used, np.array([[0, 1], [1, 0], [0, 2]]), 4)
    (array([ 1,  1, -1]), array([-1,  1,  0]))
    """
    objects, half = offsets.size - 1, directions // 2
    separating = np.full(pairs.shape[0], -1, dtype=np.int64)
    orders = np.zeros(pairs.shape[0], dtype=np.int64)
    widest = np.zeros(pairs.shape[0])
    spans = np.empty((objects, 2))
    for direction in range(half):
        cosine, sine = direction_cosines(direction, directions)
        for k in range(objects):
            if used[k]:
                low, high = np.inf, -np.inf
                for e in range(offsets[k], offsets[k + 1]):
                    u = starts[e, 0] * cosine + starts[e, 1] * sine
                    low, high = min(low, u), max(high, u)
                spans[k, 0], spans[k, 1] = low, high
        for p in range(pairs.shape[0]):
            a, b = pairs[p, 0], pairs[p, 1]
            forward, backward = spans[a, 0] - spans[b, 1], spans[b, 0] - spans[a, 1]
            gap = max(forward, backward)
            if gap > widest[p] or (gap == 0.0 and separating[p] < 0):
                widest[p] = gap
                separating[p] = direction
                orders[p] = 1 if forward >= backward else -1
    return separating, orders
