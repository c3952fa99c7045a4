"""Hypothesis strategies that tests share: awkward shapes, scenes and relation tables."""

import math
from dataclasses import replace

import numpy as np
import shapely
from hypothesis import assume
from hypothesis import strategies as st

from sketchmatch.model import RelationTable, Scene, SceneObject, pair_count

# Rectilinear shapes on whole numbers: notches, collinear corners, edges along the axes.
CORNERED = [
    [(0, 0), (1, 0), (1, 1), (0, 1)],
    [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (0, 2), (0, 1)],
    [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)],
    [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)],
    [(0, 0), (2, 0), (1, 1)],
    [
        (0, 0),
        (5, 0),
        (5, 2),
        (4, 2),
        (4, 1),
        (3, 1),
        (3, 2),
        (2, 2),
        (2, 1),
        (1, 1),
        (1, 2),
        (0, 2),
    ],
    [(1, 0), (2, 1), (1, 2), (0, 1)],
]
FRAME = [[(0, 0), (3, 0), (3, 3), (0, 3)], [(1, 1), (1, 2), (2, 2), (2, 1)]]


def floats(low, high):
    return st.floats(low, high, allow_nan=False, allow_subnormal=False)


@st.composite
def star_rings(draw, holes=None):
    """Return the rings of a polygon star-shaped about the origin, of radius 0.2 to 1."""
    count = draw(st.integers(3, 9))
    radii = draw(st.lists(floats(0.2, 1.0), min_size=count, max_size=count))
    late = draw(st.lists(floats(0.0, 0.45), min_size=count, max_size=count))
    angles = 2 * math.pi * (np.arange(count) + late) / count
    outer = np.stack([np.cos(angles), np.sin(angles)], axis=1) * np.array(radii)[:, None]
    return (
        [outer, 0.5 * outer[::-1]]
        if draw(st.booleans() if holes is None else st.just(holes))
        else [outer]
    )


@st.composite
def cornered_rings(draw):
    """Return the rings of a rectilinear shape on whole numbers, turned by quarters."""
    rings = draw(st.sampled_from([*([ring] for ring in CORNERED), FRAME]))
    quarter = np.linalg.matrix_power(np.array([[0, 1], [-1, 0]]), draw(st.integers(0, 3)))
    return [np.array(ring, dtype=float) @ quarter for ring in rings]


@st.composite
def beside_the_origin(draw):
    """Return a shape of about size 1 that lies on the origin, beside it or around it."""
    rings = draw(st.one_of(star_rings(), cornered_rings()))
    offset = draw(st.tuples(floats(-3.0, 3.0), floats(-3.0, 3.0)))
    return [ring + offset for ring in rings]


@st.composite
def pairs_of_rings(draw):
    """Return two shapes that may lie apart, touch, overlap or enclose each other."""
    whole = st.tuples(st.integers(-4, 4), st.integers(-4, 4))
    close = st.tuples(floats(-2.0, 2.0), floats(-2.0, 2.0))
    far = st.tuples(st.sampled_from([-2000.0, 0.0, 1000.0]), floats(-3000.0, 3000.0))
    first, second = (draw(st.one_of(star_rings(), cornered_rings())) for _ in range(2))
    offset = np.array(draw(st.one_of(whole, close, far)), dtype=float)
    growth = draw(st.sampled_from([1.0, 1.0, 0.25, 5.0]))
    scale = draw(st.sampled_from([1.0, 1.0, 1e-6, 1e7]))
    return (
        [scale * ring for ring in first],
        [scale * (growth * ring + offset) for ring in second],
    )


@st.composite
def scenes(draw, least=2, most=5):
    """Return a scene of objects that lie apart, on no regular grid."""
    count = draw(st.integers(least, most))
    objects = []
    for k in range(count):
        rings = draw(star_rings())
        size, dx, dy = draw(floats(0.5, 1.2)), draw(floats(0.0, 1.0)), draw(floats(0.0, 1.0))
        centre = np.array([4.0 * (k % 3) + dx, 4.0 * (k // 3) + dy])
        objects.append(SceneObject.from_rings([size * ring + centre for ring in rings]))
    return Scene(tuple(objects))


def random_table(rng, template_objects, argument_objects):
    """Return a relation table of independent random values."""
    shape = (pair_count(template_objects), pair_count(argument_objects))
    return RelationTable(
        rng.uniform(0.0, 1.0, shape),
        rng.uniform(0.0, 2 * np.pi, shape),
        np.exp(rng.uniform(-1.5, 1.5, shape)),
        template_objects,
        argument_objects,
    )


@st.composite
def tables(draw, least=2, most=7, more=4):
    """Return a random relation table of ``least`` to ``most`` template objects."""
    template = draw(st.integers(least, most))
    argument = template + draw(st.integers(0, more))
    return random_table(np.random.default_rng(draw(st.integers(0, 2**32))), template, argument)


def with_evidence(rng, table):
    """Return a table with random evidence beyond σ for every entry."""
    shape = (table.template_pairs, 2 * table.argument_pairs)
    return replace(table, evidence=rng.uniform(0.0, 1.0, shape))


def with_rotation_weights(rng, table):
    """Return a table whose pairs' rotations count for very different random weights."""
    return replace(table, rotation_weights=np.exp(rng.normal(0.0, 1.0, table.template_pairs)))


@st.composite
def tables_and_object_maps(draw, most=7):
    """Return a random relation table and an injective object map.

    The table may have evidence and rotation weights.
    """
    table = draw(tables(most=most))
    for add in (with_evidence, with_rotation_weights):
        if draw(st.booleans()):
            table = add(np.random.default_rng(draw(st.integers(0, 2**32))), table)
    order = draw(st.permutations(range(table.argument_objects)))
    return table, np.array(order[: table.template_objects])


@st.composite
def pairs_apart(draw):
    """Return two shapes with a gap between them: no force between them is infinite.

    Beside each other, interlocked, far apart, on whole numbers, or of sizes far from each other;
    all of it tiny, huge or neither.
    """
    first, second = draw(
        st.one_of(beside(), interlocked(), far_apart(), on_whole_numbers(), posts())
    )
    scale = draw(st.sampled_from([1.0, 1.0, 2.0**-20, 2.0**23]))
    if draw(st.booleans()):
        first, second = second, first
    return [scale * ring for ring in first], [scale * ring for ring in second]


@st.composite
def beside(draw):
    """Return two shapes whose bounding boxes keep a gap of 0.02 to 3."""
    first, second = (draw(st.one_of(star_rings(), cornered_rings())) for _ in range(2))
    gap, aside = draw(floats(0.02, 3.0)), draw(floats(-2.0, 2.0))
    second = moved_beside(first, second, gap, aside)
    return _quartered(draw, first, second)


@st.composite
def on_whole_numbers(draw):
    """Return two rectilinear shapes, a whole number apart: edges in line and parallel."""
    first, second = draw(cornered_rings()), draw(cornered_rings())
    second = moved_beside(first, second, draw(st.integers(1, 4)), draw(st.integers(-3, 3)))
    return _quartered(draw, first, second)


@st.composite
def interlocked(draw):
    """Return a U around a bar, or a ring around a shape: apart, but in turns along lines."""
    inside, gap = draw(star_rings()), draw(floats(0.03, 1.0))
    reach = 1.0 + gap
    frame = reach * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    if draw(st.booleans()):
        return [frame + frame, frame[::-1]], inside
    thick = draw(floats(0.1, 1.0))
    wide = reach + thick
    u = np.array(
        [
            [-wide, -wide],
            [wide, -wide],
            [wide, reach],
            [reach, reach],
            [reach, -reach],
            [-reach, -reach],
            [-reach, reach],
            [-wide, reach],
        ]
    )
    bar = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [1.0, draw(floats(0.1, 5.0))]
    bar = bar + np.array([0.0, bar[:, 1].max() - 1.0])
    return _quartered(draw, [u], [bar] if draw(st.booleans()) else inside)


@st.composite
def far_apart(draw):
    """Return two shapes 100 to 100 000 times their size apart, along an axis or a diagonal."""
    first, second = (draw(st.one_of(star_rings(), cornered_rings())) for _ in range(2))
    distance = 10.0 ** draw(st.sampled_from([2, 3, 4, 5]))
    offset = distance * np.array([1.0, draw(st.sampled_from([0.0, 1.0]))])
    offset += [0.0, draw(floats(-1.0, 1.0))]
    return _quartered(draw, first, [ring + offset for ring in second])


@st.composite
def slivers(draw):
    """Return two triangles a thousand times as long as wide, some of them along an axis."""

    def sliver():
        turn = draw(st.sampled_from([0.0, 0.25, 1e-3, -1e-3, draw(floats(0.0, 1.0))])) * math.tau
        c, s = math.cos(turn), math.sin(turn)
        width = draw(floats(5e-4, 2e-3))
        ring = np.array([[-0.5, 0.0], [0.5, draw(floats(-width, 0.0))], [0.5, width]])
        return [ring @ np.array([[c, s], [-s, c]])]

    first, second = sliver(), draw(st.one_of(st.just(sliver()), star_rings()))
    gap, aside = draw(floats(0.02, 0.5)), draw(floats(-0.5, 0.5))
    return _quartered(draw, first, moved_beside(first, second, gap, aside))


@st.composite
def posts(draw):
    """Return a hall of a kilometre and a post of 0.1 m near a wall of it, outside or in a yard."""
    hall = [np.array([[0.0, 0.0], [1000.0, 0.0], [1000.0, 700.0], [0.0, 700.0]])]
    yard = np.array([[400.0, 300.0], [400.0, 400.0], [500.0, 400.0], [500.0, 300.0]])
    (post,) = draw(star_rings(holes=False))
    x, y = draw(floats(0.1, 50.0)), draw(floats(10.0, 80.0))
    if draw(st.booleans()):
        return [*hall, yard], [0.1 * post + [400.1 + x, 305.0 + y]]
    return hall, [0.1 * post + [1000.1 + x, 5.0 + y]]


@st.composite
def pairs_in_touch(draw):
    """Return two rectilinear shapes that share part of an edge, or a corner, and nothing else."""
    first, second = draw(cornered_rings()), draw(cornered_rings())
    offset = draw(st.sampled_from(_ways_to_touch(first, second)))
    scale = draw(st.sampled_from([1.0, 1.0, 2.0**-20, 2.0**23]))
    return [scale * ring for ring in first], [scale * (ring + offset) for ring in second]


@st.composite
def pairs_in_overlap(draw):
    """Return two shapes that have a good part of one of them in common, or all of it."""
    first, second = (draw(st.one_of(star_rings(), cornered_rings())) for _ in range(2))
    if draw(st.integers(0, 3)) == 0:
        second = first
    half = st.sampled_from([-1.0, -0.5, 0.0, 0.5, 1.0])
    offset = draw(st.one_of(st.tuples(half, half), st.tuples(floats(-1, 1), floats(-1, 1))))
    second = [ring + offset for ring in second]
    common = as_polygon(first).intersection(as_polygon(second)).area
    assume(common > 0.01 * min(as_polygon(first).area, as_polygon(second).area))
    scale = draw(st.sampled_from([1.0, 1.0, 2.0**-20, 2.0**23]))
    return [scale * ring for ring in first], [scale * ring for ring in second]


def as_polygon(rings):
    return shapely.Polygon(rings[0], rings[1:])


def moved_beside(first, second, gap, aside):
    """Return the second shape to the right of the first, a gap away, and off its middle."""
    right = first[0][:, 0].max() + gap - second[0][:, 0].min()
    return [ring + np.array([right, aside]) for ring in second]


def _quartered(draw, *shapes):
    quarter = np.linalg.matrix_power(np.array([[0, 1], [-1, 0]]), draw(st.integers(0, 3)))
    return tuple([ring @ quarter for ring in rings] for rings in shapes)


def _ways_to_touch(first, second):
    whole = [np.array([x, y], dtype=float) for x in range(-7, 8) for y in range(-7, 8)]
    one = as_polygon(first)
    return [way for way in whole if one.touches(as_polygon([ring + way for ring in second]))]
