"""Hypothesis strategies that tests share: awkward shapes, scenes and relation tables."""

import math

import numpy as np
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


@st.composite
def tables_and_object_maps(draw, most=7):
    """Return a random relation table and an injective object map."""
    table = draw(tables(most=most))
    order = draw(st.permutations(range(table.argument_objects)))
    return table, np.array(order[: table.template_objects])
