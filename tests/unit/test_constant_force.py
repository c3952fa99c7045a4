"""The constant-force kernel against its definition, its known properties and values by hand."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from sketchmatch import force_histogram
from tests.interpreted import examples
from tests.oracle.forces import force_histogram as by_definition
from tests.strategies import (
    FRAME,
    beside_the_origin,
    cornered_rings,
    floats,
    pairs_of_rings,
    star_rings,
)

checked = examples(60)


def assert_same(computed, expected, first, second):
    """Compare within a share of the histogram's highest value.

    Where two objects only graze each other in all directions, that value is itself a rounding of
    their coordinates; a share of the force between compact objects of their areas then takes its
    place.
    """
    one, other = (math.sqrt(shapely.Polygon(r[0], r[1:]).area) for r in (first, second))
    floor = 0.1 * one**2 * other**2 / (one + other)
    assert np.abs(computed - expected).max() <= 1e-9 * max(np.max(expected), floor)


def turned(rings, angle):
    c, s = math.cos(angle), math.sin(angle)
    return [ring @ np.array([[c, s], [-s, c]]) for ring in rings]


@given(pairs_of_rings(), st.sampled_from([4, 8, 12]))
@examples(400)
def test_it_agrees_with_the_definition(shapes, directions):
    computed = force_histogram(*shapes, directions=directions)
    assert_same(computed, by_definition(*shapes, directions), *shapes)


@pytest.mark.slow
@given(pairs_of_rings())
@examples(12)
def test_it_agrees_with_the_definition_in_180_directions(shapes):
    assert_same(force_histogram(*shapes), by_definition(*shapes, 180), *shapes)


@pytest.mark.slow
@given(cornered_rings(), cornered_rings(), st.tuples(st.integers(-4, 4), st.integers(-4, 4)))
@examples(200)
def test_it_agrees_where_edges_lie_on_each_other_and_along_the_direction(first, second, offset):
    second = [ring + offset for ring in second]
    computed = force_histogram(first, second, directions=8)
    assert_same(computed, by_definition(first, second, 8), first, second)


@given(pairs_of_rings(), st.sampled_from([4, 12, 180]))
@checked
def test_the_dual_is_the_histogram_turned_by_half(shapes, directions):
    first, second = shapes
    forward = force_histogram(first, second, directions=directions)
    backward = force_histogram(second, first, directions=directions)
    assert_same(forward, np.roll(backward, directions // 2), *shapes)


@given(pairs_of_rings(), st.integers(1, 11))
@checked
def test_turning_both_objects_shifts_it(shapes, steps):
    first, second = (turned(rings, math.tau * steps / 12) for rings in shapes)
    moved = force_histogram(first, second, directions=12)
    assert_same(moved, np.roll(force_histogram(*shapes, directions=12), steps), *shapes)


@given(pairs_of_rings(), floats(0.01, 100.0))
@checked
def test_scaling_both_objects_multiplies_it_by_the_third_power(shapes, factor):
    first, second = ([factor * ring for ring in rings] for rings in shapes)
    scaled = force_histogram(first, second, directions=12)
    assert_same(scaled, factor**3 * force_histogram(*shapes, directions=12), first, second)


@given(pairs_of_rings(), st.tuples(floats(-100.0, 100.0), floats(-100.0, 100.0)))
@checked
def test_moving_both_objects_changes_nothing(shapes, way):
    size = max(np.ptp(ring) for rings in shapes for ring in rings)
    first, second = ([ring + size * np.array(way) for ring in rings] for rings in shapes)
    assume(min(np.ptp(ring, axis=0).min() for ring in first + second) > 1e-3 * size)
    assert_same(
        force_histogram(first, second, directions=12),
        force_histogram(*shapes, directions=12),
        *shapes,
    )


@given(pairs_of_rings(), st.integers(0, 8), st.booleans())
@checked
def test_where_a_ring_starts_and_which_way_it_runs_changes_nothing(shapes, start, reverse):
    first, second = shapes
    other = [np.roll(ring, start, axis=0)[:: -1 if reverse else 1] for ring in first]
    assert_same(
        force_histogram(other, second, directions=12),
        force_histogram(first, second, directions=12),
        *shapes,
    )


@given(star_rings(holes=False), beside_the_origin())
@checked
def test_the_parts_of_an_object_add_up(star, second):
    (outer,) = star
    fan = zip(outer, np.roll(outer, -1, axis=0), strict=True)
    parts = [np.array([[0.0, 0.0], p, q]) for p, q in fan]
    total = sum(force_histogram(part, second, directions=12) for part in parts)
    assert_same(total, force_histogram(outer, second, directions=12), [outer], second)


@given(star_rings(holes=True), beside_the_origin())
@checked
def test_a_hole_takes_away_its_own_histogram(ring_with_hole, second):
    outer, hole = ring_with_hole
    left = force_histogram([outer, hole], second, directions=12)
    expected = force_histogram(outer, second, directions=12) - force_histogram(
        hole, second, directions=12
    )
    assert_same(left, expected, [outer], second)


def unit_square(x=0.0, y=0.0):
    return np.array([[x, y], [x + 1, y], [x + 1, y + 1], [x, y + 1]], dtype=float)


def by_direction(a, b, directions=8):
    return force_histogram(a, b, directions=directions).tolist()


def test_unit_squares_side_by_side():
    # Along x each line meets both in sections of length 1; along the diagonal the sections are
    # √2 − 2w and 2w for 0 < w < 1/√2.
    diagonal = math.sqrt(2) / 6
    expected = [1.0, diagonal, 0, 0, 0, 0, 0, diagonal]
    assert by_direction(unit_square(1, 0), unit_square()) == pytest.approx(expected)


def test_right_is_direction_zero_and_up_is_a_quarter():
    assert by_direction(unit_square(5, 0), unit_square(), 4) == pytest.approx([1.0, 0, 0, 0])
    assert by_direction(unit_square(0, 5), unit_square(), 4) == pytest.approx([0, 1.0, 0, 0])


def test_distance_neither_weakens_a_constant_force_nor_costs_digits():
    leaf = np.array([[0.13, 0.02], [1.71, 0.38], [0.97, 1.23], [0.31, 0.91]])
    for order in (1, -1):
        near, far = (
            by_direction(*(leaf + np.array([x, 0.1]), leaf)[::order], 4) for x in (10.0, 1e6)
        )
        assert max(near) > 0.0
        assert near == pytest.approx(far, rel=1e-9)


def test_an_object_on_itself_pulls_half_of_its_sections_each_way():
    assert by_direction(unit_square(), unit_square(), 4) == pytest.approx([0.5] * 4)


def test_half_overlapping_squares():
    # On each line u_a < u_b on a triangle of half by half.
    assert by_direction(unit_square(0.5, 0), unit_square(), 4) == pytest.approx(
        [0.875, 0.25, 0.125, 0.25]
    )


def test_an_object_in_the_hole_of_another_is_surrounded():
    inside = unit_square(1, 1)
    assert by_direction(FRAME, inside, 4) == pytest.approx([1.0] * 4)
    assert by_direction(inside, FRAME, 4) == pytest.approx([1.0] * 4)


def test_objects_that_no_line_joins_have_no_force():
    computed = by_direction(unit_square(100, 3), unit_square(), 4)
    assert computed == [0.0] * 4


def test_every_tooth_of_a_long_comb_counts():
    teeth = 300
    comb = np.array([(0, 0), (2 * teeth - 1, 0), *_teeth(teeth)], dtype=float)
    computed = force_histogram(comb, unit_square(-5, 1), directions=4)
    # One line of height 1 meets the square in 1 and every tooth in 1.
    assert computed == pytest.approx([teeth, 0, 0, 0])


def _teeth(count):
    """Yield the upper side of a comb from right to left."""
    for k in reversed(range(count)):
        yield 2 * k + 1, 2
        yield 2 * k, 2
        if k:
            yield 2 * k, 1
            yield 2 * k - 1, 1
