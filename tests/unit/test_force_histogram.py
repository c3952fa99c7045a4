"""Histograms of any force and of masks: their definition, known properties and values by hand."""

import math
import re

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

import sketchmatch
from sketchmatch import InvalidInputError, force_histogram
from tests.interpreted import examples
from tests.oracle.forces import force_histogram as constant_by_definition
from tests.oracle.laws import PI, REAL, facing_force, force, law_histogram
from tests.oracle.pixels import angle_counts, mask_histogram
from tests.strategies import (
    FRAME,
    as_polygon,
    beside,
    beside_the_origin,
    cornered_rings,
    floats,
    moved_beside,
    pairs_apart,
    pairs_in_overlap,
    pairs_in_touch,
    slivers,
    star_rings,
)

checked = examples(20)
few = examples(12)

BELOW_ONE = [-3.0, -1.0, -0.5, 0.0, 0.5, 0.99, 1 - 1e-9]
BELOW_TWO = [*BELOW_ONE, 1.0, 1 + 1e-9, 1.25, 1.5, 1.75, 2 - 1e-9]
EXPONENTS = [*BELOW_TWO, 2.0, 2 + 1e-9, 2.5, 2.999, 3 - 1e-9, 3.0, 3 + 1e-9, 3.5, 6.0]
PIVOTS = [1.0, 2.0, 3.0]

exponents = st.sampled_from(EXPONENTS)

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def square(x, y):
    return SQUARE + np.array([x, y])


def assert_same(computed, expected, first, second, r, tolerance=1e-9):
    """Compare within a share of the histogram's highest value, or of what facing objects have."""
    highest = max(np.max(expected), 0.1 * facing_force(first, second, r))
    assert np.isfinite(computed).all()
    assert np.abs(computed - expected).max() <= tolerance * highest


def by_definition(first, second, r, directions=8):
    return law_histogram(first, second, force(r), directions)


def test_a_pair_alone_needs_a_number_of_directions():
    with pytest.raises(InvalidInputError, match="directions is None; give an even number"):
        force_histogram(SQUARE, SQUARE + 2.0, directions=None)


def computed(first, second, r, directions=8):
    return force_histogram(first, second, r=r, directions=directions)


def turned(rings, angle):
    c, s = math.cos(angle), math.sin(angle)
    return [ring @ np.array([[c, s], [-s, c]]) for ring in rings]


@pytest.mark.parametrize("r", EXPONENTS)
@given(shapes=pairs_apart())
@examples(15)
def test_it_agrees_with_the_definition_between_objects_apart(r, shapes):
    assert_same(computed(*shapes, r), by_definition(*shapes, r), *shapes, r)


@pytest.mark.slow
@given(pairs_apart(), floats(-8.0, 10.0))
@examples(40)
def test_it_agrees_with_the_definition_at_any_exponent(shapes, r):
    assert_same(computed(*shapes, r), by_definition(*shapes, r), *shapes, r)


@pytest.mark.slow
@given(slivers(), st.one_of(exponents, floats(-4.0, 10.0)))
@examples(60)
def test_slivers_keep_eight_digits(shapes, r):
    # What a force makes of a width w is a second difference: w² of its digits are lost.
    assert_same(computed(*shapes, r), by_definition(*shapes, r), *shapes, r, tolerance=1e-8)


@pytest.mark.parametrize("r", [-3.0, -6.0, -6.5, -9.5])
def test_slivers_along_each_other_keep_eight_digits(r):
    first = [np.array([[0.0, -0.5], [0.000142, 0.5], [-0.0005, 0.5]])]
    second = [np.array([[0.021644, -0.5], [0.021644, 0.5], [0.020142, 0.5]])]
    expected = by_definition(first, second, r)
    assert_same(computed(first, second, r), expected, first, second, r, tolerance=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("r", BELOW_TWO)
@given(shapes=pairs_in_touch())
@examples(15)
def test_it_agrees_with_the_definition_between_objects_in_touch(r, shapes):
    assert_same(computed(*shapes, r), by_definition(*shapes, r), *shapes, r)


@pytest.mark.slow
@pytest.mark.parametrize("r", BELOW_ONE)
@given(shapes=pairs_in_overlap())
@examples(15)
def test_it_agrees_with_the_definition_between_objects_in_overlap(r, shapes):
    assert_same(computed(*shapes, r), by_definition(*shapes, r), *shapes, r)


@pytest.mark.slow
@given(beside(), exponents)
@few
def test_it_agrees_with_the_definition_in_60_directions(shapes, r):
    assert_same(computed(*shapes, r, 60), by_definition(*shapes, r, 60), *shapes, r)


@pytest.mark.parametrize("r", EXPONENTS)
@pytest.mark.parametrize("gap", [1e-6, 1e-3])
def test_objects_with_hardly_any_gap_keep_their_digits(r, gap):
    # A power of two, so that the gap is the same number at every place.
    gap = 2.0 ** round(math.log2(gap))
    first, second = [square(1 + gap, 0.25)], [SQUARE]
    assert_same(computed(first, second, r), by_definition(first, second, r), first, second, r)


@given(st.one_of(pairs_apart(), pairs_in_touch()), st.sampled_from(BELOW_TWO))
@checked
def test_the_dual_is_the_histogram_turned_by_half(shapes, r):
    first, second = shapes
    backward = computed(second, first, r, 12)
    assert_same(computed(first, second, r, 12), np.roll(backward, 6), first, second, r)


@given(beside(), st.integers(1, 11), exponents)
@checked
def test_turning_both_objects_shifts_it(shapes, steps, r):
    first, second = (turned(rings, math.tau * steps / 12) for rings in shapes)
    moved = computed(first, second, r, 12)
    assert_same(moved, np.roll(computed(*shapes, r, 12), steps), *shapes, r)


@given(pairs_apart(), floats(0.01, 100.0), exponents)
@checked
def test_scaling_both_objects_multiplies_it_by_a_power(shapes, factor, r):
    first, second = ([factor * ring for ring in rings] for rings in shapes)
    expected = factor ** (3 - r) * computed(*shapes, r)
    assert_same(computed(first, second, r), expected, first, second, r)


@given(beside(), st.tuples(floats(-100.0, 100.0), floats(-100.0, 100.0)), exponents)
@checked
def test_moving_both_objects_changes_nothing(shapes, way, r):
    first, second = ([ring + np.array(way) for ring in rings] for rings in shapes)
    assert_same(computed(first, second, r), computed(*shapes, r), *shapes, r)


@given(pairs_apart(), st.integers(0, 8), st.booleans(), exponents)
@checked
def test_where_a_ring_starts_and_which_way_it_runs_changes_nothing(shapes, start, reverse, r):
    first, second = shapes
    other = [np.roll(ring, start, axis=0)[:: -1 if reverse else 1] for ring in first]
    assert_same(computed(other, second, r), computed(first, second, r), *shapes, r)


@given(star_rings(holes=False), st.one_of(star_rings(), cornered_rings()), exponents)
@checked
def test_the_parts_of_an_object_add_up(star, shape, r):
    (outer,) = star
    second = moved_beside([outer], shape, 0.25, 0.125)
    fan = zip(outer, np.roll(outer, -1, axis=0), strict=True)
    parts = [np.array([[0.0, 0.0], p, q]) for p, q in fan]
    total = sum(computed(part, second, r) for part in parts)
    assert_same(total, computed([outer], second, r), [outer], second, r)


@given(star_rings(holes=True), beside_the_origin(), st.sampled_from(BELOW_ONE))
@checked
def test_a_hole_takes_away_its_own_histogram(ring_with_hole, second, r):
    outer, hole = ring_with_hole
    left = computed([outer, hole], second, r)
    whole = computed([outer], second, r)
    floor = 1e-9 * max(whole.max(), 1e-3)
    assert np.abs(left + computed([hole], second, r) - whole).max() <= floor


@pytest.mark.parametrize("pivot", PIVOTS)
@given(shapes=beside())
@few
def test_it_is_continuous_in_the_exponent(pivot, shapes):
    at = computed(*shapes, pivot)
    for step in (-1e-7, 1e-7):
        # dF/dr = −∬∫ ln(d)·φ; |ln d| < 5 here.
        assert_same(computed(*shapes, pivot + step), at, *shapes, pivot, tolerance=1e-6)


@pytest.mark.parametrize("r", [-10.0, 10.0])
def test_objects_just_far_enough_apart_for_an_expansion_keep_twelve_digits(r):
    oblong = SQUARE * np.array([1.2, 1.0])
    shapes = [oblong + np.array([79.0, 0.0])], [oblong]
    assert_same(computed(*shapes, r), by_definition(*shapes, r), *shapes, r, tolerance=3e-13)


@given(beside(), exponents)
@few
def test_objects_far_apart_pull_like_points(shapes, r):
    # All directions together: ∫F dθ = ∬ ρ^(−1−r) da db, about A_a A_b / D^(1+r).
    first, second = shapes
    second = [0.4 * ring + np.array([-50.0, 9.0]) for ring in second]
    first = [0.4 * ring for ring in first]
    one, other = as_polygon(first), as_polygon(second)
    expected = one.area * other.area * one.centroid.distance(other.centroid) ** (-1 - r)
    total = computed(first, second, r, 3600).sum() * math.tau / 3600
    assert total == pytest.approx(expected, rel=0.2)


@given(beside_the_origin(), beside_the_origin())
@few
def test_all_angles_together_are_all_pairs_of_points(first, second):
    total = computed(first, second, -1.0, 3600).sum() * math.tau / 3600
    pairs = as_polygon(first).area * as_polygon(second).area
    assert total == pytest.approx(pairs, rel=1e-3)


# Values by hand ----------------------------------------------------------------------------------

BESIDE = {  # by (gap, r): Ψ(2 + gap) − 2Ψ(1 + gap) + Ψ(gap)
    (0, -1): 1.0,
    (0, 0.5): 4 / 3 * (2**1.5 - 2),
    (0, 1): 2 * math.log(2),
    (0, 1.5): 4 * (2 - math.sqrt(2)),
    (1, -1): 2.0,
    (1, 0.5): 4 / 3 * (3**1.5 - 2 * 2**1.5 + 1),
    (1, 1): 3 * math.log(3) - 4 * math.log(2),
    (1, 2): math.log(4 / 3),
    (1, 3): 1 / 6,
}


@pytest.mark.parametrize(("gap", "r"), BESIDE)
def test_unit_squares_side_by_side(gap, r):
    first, second = [square(1 + gap, 0)], [SQUARE]
    expected = pytest.approx(BESIDE[gap, r], rel=1e-13)
    assert by_definition(first, second, r)[0] == expected
    assert computed(first, second, r)[0] == pytest.approx(BESIDE[gap, r], rel=1e-12)


@pytest.mark.parametrize("r", [-3.0, -0.5, 0.0, 0.5, 1.25, 1.75])
def test_unit_squares_corner_to_corner(r):
    # Along the diagonal the sections are √2 − 2w long, 2w apart, 0 < w < 1/√2; with Ω' = Ψ this is
    # Ω(2√2) − 2√2 Ψ(√2).
    root = math.sqrt(2)
    psi = root ** (2 - r) / ((1 - r) * (2 - r))
    omega = (2 * root) ** (3 - r) / ((1 - r) * (2 - r) * (3 - r))
    expected = [0, omega - 2 * root * psi, 0, 0, 0, 0, 0, 0]
    assert by_definition([SQUARE + 1], [SQUARE], r) == pytest.approx(expected, rel=1e-13)
    assert computed([SQUARE + 1], [SQUARE], r) == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("r", [-2.0, 0.0, 0.9])
def test_an_object_on_itself_pulls_equally_each_way(r):
    expected = pytest.approx([1 / ((1 - r) * (2 - r))] * 4, rel=1e-9)
    assert by_definition([SQUARE], [SQUARE], r, 4) == expected
    assert computed([SQUARE], [SQUARE], r, 4) == expected


def test_objects_that_no_line_joins_have_no_force():
    for r in EXPONENTS:
        assert not computed([square(100, 3)], [SQUARE], r, 4).any()


def test_the_definition_is_the_one_of_constant_forces():
    rng = np.random.default_rng(3)
    for _ in range(10):
        first, second = (rng.uniform(-1, 1, 2) + _hexagon(rng) for _ in range(2))
        expected = constant_by_definition([first], [second], 12)
        found = by_definition([first], [second], 0.0, 12)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14 * expected.max())


@pytest.mark.parametrize("r", [-3.0, -0.5, 0.5, 1.25, 2.5, 3.5, 6.0])
def test_the_definition_is_the_second_difference_of_psi(r):
    # Two right-angled triangles back to back: sections of length v on both sides of a gap of 0.5.
    first, second = np.array([[0.5, 0], [1.5, 1], [0.5, 1]]), np.array([[0, 0], [0, 1], [-1, 1.0]])
    nodes, weights = np.polynomial.legendre.leggauss(40)
    lengths = (1 + nodes.astype(REAL)) / 2

    def psi(d):
        return d ** (2 - REAL(r)) / ((1 - REAL(r)) * (2 - REAL(r)))

    forces = psi(0.5 + 2 * lengths) - 2 * psi(0.5 + lengths) + psi(REAL(0.5))
    expected = float(forces @ weights / 2)
    assert by_definition([first], [second], r, 4)[0] == pytest.approx(expected, rel=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("r", [-3.0, -1.0, 0.5, 1.0, 2.0, 3.5])
def test_the_definition_adds_up_to_the_force_between_all_points(r):
    shear = np.array([[1.0, 0.3], [-0.2, 0.8]])
    first, second = square(2.0, 0.5), SQUARE @ shear
    nodes, weights = np.polynomial.legendre.leggauss(10)
    grid = np.stack(np.meshgrid((1 + nodes) / 2, (1 + nodes) / 2), axis=-1).reshape(-1, 2)
    mass = np.outer(weights / 2, weights / 2).ravel()
    sheared = grid @ shear
    distances = np.hypot(*((grid + np.array([2.0, 0.5]))[:, None] - sheared).transpose(2, 0, 1))
    expected = as_polygon([second]).area * (mass @ distances ** (-1 - r) @ mass)
    total = by_definition([first], [second], r, 360).sum() * float(2 * PI / 360)
    assert total == pytest.approx(expected, rel=1e-5)


def _hexagon(rng):
    angles = math.tau * (np.arange(6) + rng.uniform(0.0, 0.45, 6)) / 6
    return np.stack([np.cos(angles), np.sin(angles)], axis=1) * rng.uniform(0.2, 1, (6, 1))


# Infinite forces ---------------------------------------------------------------------------------


def assert_refused(*arguments, **options):
    with pytest.raises(InvalidInputError) as caught:
        force_histogram(*arguments, **options)
    message = str(caught.value)
    assert re.search(r"\ba\b.*\bb\b", message), "names both objects"
    assert "hybrid" in message, "offers a remedy"


@pytest.mark.parametrize("r", [1.0, 1 + 1e-9, 1.5, 2.0, 3.0, 10.0])
@given(shapes=pairs_in_overlap())
@examples(5)
def test_overlap_is_refused_where_the_force_would_be_infinite(r, shapes):
    assert_refused(*shapes, r=r, directions=8)


@pytest.mark.parametrize("r", [2.0, 2.5, 3.0, 10.0])
@given(shapes=pairs_in_touch())
@examples(5)
def test_contact_is_refused_where_the_force_would_be_infinite(r, shapes):
    assert_refused(*shapes, r=r, directions=8)


@pytest.mark.parametrize("r", [1.0, 2.0])
def test_an_object_within_another_or_on_itself_overlaps_it(r):
    assert_refused(SQUARE, SQUARE, r=r)
    assert_refused(SQUARE, 0.25 * SQUARE + 0.25, r=r)
    assert_refused(0.25 * SQUARE + 0.25, SQUARE, r=r)


@pytest.mark.parametrize("r", [1.0, 2.0, 3.0])
def test_an_object_in_the_hole_of_another_does_not(r):
    inside = [0.5 * SQUARE + 1.25]
    assert_same(computed(FRAME, inside, r), by_definition(FRAME, inside, r), FRAME, inside, r)


@pytest.mark.parametrize("r", [-10.0, -3.0, 0.99, 1 - 1e-12])
def test_forces_near_the_infinite_are_finite_in_overlap(r):
    assert np.isfinite(computed([SQUARE], [SQUARE + 0.5], r)).all()
    assert np.isfinite(computed([SQUARE], [SQUARE], r)).all()


@pytest.mark.parametrize("r", [1.0, 1.99, 2 - 1e-12])
def test_forces_near_the_infinite_are_finite_in_touch(r):
    assert np.isfinite(computed([SQUARE], [square(1, 0.5)], r)).all()
    assert np.isfinite(computed([SQUARE], [SQUARE + 1], r)).all()


def test_forces_near_the_infinite_are_finite_over_a_hair():
    for r in (2.0, 3.0, 10.0):
        found = computed([SQUARE], [square(1 + 1e-9, 0)], r)
        assert np.isfinite(found).all()
        assert found.min() >= 0.0


@pytest.mark.parametrize("r", [math.nan, math.inf, -math.inf, 11.0, -10.5, "much", None])
def test_exponents_that_cannot_be_are_refused(r):
    with pytest.raises(InvalidInputError, match=r"\br\b"):
        force_histogram(SQUARE, SQUARE + 3.0, r=r)


# Masks -------------------------------------------------------------------------------------------


@st.composite
def pairs_of_masks(draw, overlap):
    """Return two masks of one shape, neither empty; apart where they may not overlap."""
    shape = draw(st.tuples(st.integers(2, 6), st.integers(2, 6)))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    density = draw(st.sampled_from([0.2, 0.5, 0.9]))
    a, b = rng.random((2, *shape)) < density
    i, j = (int(rng.integers(n)) for n in shape)
    a[i, j] = True
    b = b if overlap else b & ~a
    if not b.any():
        b[i - 1, j] = True
        a[i - 1, j] &= overlap
    return a, b


@pytest.mark.slow
@pytest.mark.parametrize("r", [-1.0, 0.0, 0.5, 0.99])
@given(masks=pairs_of_masks(overlap=True))
@few
def test_masks_agree_with_the_sum_over_their_pixels(r, masks):
    expected = mask_histogram(*masks, r, 8)
    found = force_histogram(*masks, r=r, directions=8)
    assert np.abs(found - expected).max() <= 1e-9 * expected.max()


@pytest.mark.parametrize("r", [1.0, 1.5])
@given(masks=pairs_of_masks(overlap=False))
@few
def test_masks_apart_agree_with_the_sum_over_their_pixels(r, masks):
    expected = mask_histogram(*masks, r, 8)
    found = force_histogram(*masks, r=r, directions=8)
    assert np.abs(found - expected).max() <= 1e-9 * expected.max()


@pytest.mark.parametrize("r", [1.0, 2.0, 3.5])
def test_masks_with_a_gap_agree_with_the_sum_over_their_pixels(r):
    a, b = np.zeros((2, 6, 7), dtype=bool)
    a[:2, :2], a[4, 3] = True, True
    b[:3, 4:], b[5, 6] = True, True
    b[2, 4] = False
    expected = mask_histogram(a, b, r, 12)
    found = force_histogram(a, b, r=r, directions=12)
    assert np.abs(found - expected).max() <= 1e-9 * expected.max()


def test_row_zero_of_a_mask_is_its_top():
    a, b = np.zeros((2, 4, 3), dtype=bool)
    a[0, 1], b[2, 1] = True, True
    assert force_histogram(a, b, directions=4) == pytest.approx([0, 1.0, 0, 0])
    assert force_histogram(a.T, b.T, directions=4) == pytest.approx([0, 0, 1.0, 0])


@given(pairs_of_masks(overlap=True), st.integers(1, 4), st.integers(0, 3))
@few
def test_a_border_of_nothing_around_masks_changes_nothing(masks, before, after):
    wider = [np.pad(mask, ((before, after), (after, before))) for mask in masks]
    found = force_histogram(*wider, directions=12)
    assert found == pytest.approx(force_histogram(*masks, directions=12), rel=1e-9, abs=1e-12)


def test_a_block_of_pixels_is_the_polygon_around_it():
    a, b = np.zeros((2, 40, 50), dtype=bool)
    a[5:30, 3:20] = True
    b[10:35, 28:45] = True
    first, second = shapely.box(3, 10, 20, 35), shapely.box(28, 5, 45, 30)
    rings = [np.array(shape.exterior.coords[:-1]) for shape in (first, second)]
    for r in (0.0, -1.0, 1.0, 2.0):
        found = force_histogram(a, b, r=r, directions=36)
        expected = by_definition([rings[0]], [rings[1]], r, 36)
        assert np.abs(found - expected).max() <= 1e-9 * expected.max()


def test_masks_that_would_pull_infinitely_are_refused():
    a, b = np.zeros((2, 3, 4), dtype=bool)
    a[1, :2], b[1, 2:] = True, True
    assert_refused(a, b, r=2.0)
    assert np.isfinite(force_histogram(a, b, r=1.9)).all()
    b[1, 1] = True
    assert_refused(a, b, r=1.0)
    a, b = np.eye(2, dtype=bool) & [[True, False]], np.eye(2, dtype=bool) & [[False, True]]
    assert_refused(a, b, r=2.0)


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (np.ones((3, 3), bool), np.ones((3, 4), bool)),
        (np.ones((3, 3), bool), np.zeros((3, 3), bool)),
        (np.zeros((3, 3), bool), np.ones((3, 3), bool)),
        (np.ones((0, 3), bool), np.ones((0, 3), bool)),
        (np.ones(9, bool), np.ones(9, bool)),
        (np.ones((2, 3, 3), bool), np.ones((2, 3, 3), bool)),
        (np.ones((3, 3), bool), SQUARE),
        (SQUARE, np.ones((3, 3), bool)),
    ],
    ids=["shapes", "empty-b", "empty-a", "no-rows", "flat", "deep", "one-mask", "other-mask"],
)
def test_masks_that_cannot_be_are_refused_in_one_sentence(a, b):
    with pytest.raises(InvalidInputError) as caught:
        force_histogram(a, b)
    assert_one_sentence(caught.value)


def assert_one_sentence(error):
    message = str(error)
    assert "\n" not in message
    assert not message.endswith(".")
    assert len(message) < 250


# Label images ------------------------------------------------------------------------------------

LABELS = np.array(
    [
        [1, 1, 0, 2, 2, 0],
        [1, 0, 0, 0, 2, 0],
        [0, 0, 3, 0, 0, 4],
        [0, 3, 3, 3, 0, 4],
    ]
)


@pytest.mark.parametrize("r", [0.0, -1.0, 0.5, 1.5])
@pytest.mark.parametrize("dtype", [np.uint8, np.int32, np.int64, np.uint64])
def test_label_images_give_each_pair_in_its_order(r, dtype):
    found = sketchmatch.label_force_histograms(LABELS.astype(dtype), r=r, directions=8)
    pairs = [(a, b) for a in range(1, 5) for b in range(a + 1, 5)]
    masks = [k == LABELS for k in range(5)]
    expected = np.array([mask_histogram(masks[a], masks[b], r, 8) for a, b in pairs])
    assert found.shape == (6, 8)
    assert np.abs(found - expected).max() <= 1e-9 * expected.max()


def test_label_images_have_180_directions_and_constant_forces_unless_told():
    found = sketchmatch.label_force_histograms(LABELS)
    assert found.shape == (6, 180)
    expected = force_histogram(LABELS == 1, LABELS == 2)
    assert found[0] == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    "labels",
    [
        LABELS.astype(float),
        np.where(LABELS == 0, np.nan, LABELS),
        np.where(LABELS == 4, -1, LABELS),
        LABELS.ravel(),
        LABELS[None],
        np.zeros((3, 3), int),
        np.ones((3, 3), int),
        np.zeros((0, 0), int),
        np.where(LABELS == 2, 7, LABELS),
        np.array([["a", "b"]]),
        [[1, 2], [1]],
        None,
    ],
    ids=[
        "float",
        "nan",
        "negative",
        "flat",
        "deep",
        "nothing",
        "one",
        "empty",
        "gap-in-labels",
        "text",
        "uneven",
        "none",
    ],
)
def test_label_images_that_cannot_be_are_refused_in_one_sentence(labels):
    with pytest.raises(InvalidInputError) as caught:
        sketchmatch.label_force_histograms(labels)
    assert_one_sentence(caught.value)


def test_labels_that_would_pull_infinitely_are_refused():
    labels = np.array([[1, 2, 0, 3]])
    with pytest.raises(InvalidInputError, match=r"1.*2") as caught:
        sketchmatch.label_force_histograms(labels, r=2.0)
    assert_one_sentence(caught.value)
    assert sketchmatch.label_force_histograms(labels[:, [0, 2, 1, 2, 3]], r=2.0).all(axis=0)[0] == 0


# Angles of all pairs of points -------------------------------------------------------------------


@pytest.mark.parametrize("place", [(0.0, 0.0), (0.5, 0.25), (4.0, 1.0), (1.0, 0.0)])
def test_the_exponent_minus_one_counts_angles_of_pairs_of_points(place):
    # One point in each cell of a grid over an L and a square.
    rng = np.random.default_rng(7)
    fine = 28
    cells = np.stack(np.meshgrid(np.arange(fine), np.arange(fine)), axis=-1).reshape(-1, 2)
    ell = cells[(cells < fine // 2).any(axis=1)]
    points_a = (ell + rng.random(ell.shape)) * 2 / fine
    points_b = (cells + rng.random(cells.shape)) / fine + place
    outline = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2.0]])
    bins, each = 36, 100
    density = computed([outline], [SQUARE + place], -1.0, bins * each)
    expected = _by_bin(density, bins, each) * len(points_a) * len(points_b) / 3.0
    counts = angle_counts(points_a, points_b, bins)
    assert np.abs(counts - expected).max() <= 0.01 * expected.max()


def _by_bin(density, bins, each):
    """Return ∫F dθ over each of the bins, the first about direction 0, by the trapezoid rule."""
    turned_ = np.roll(density, each // 2)
    rows = np.concatenate([turned_, turned_[:1]])
    edges = [rows[k * each : (k + 1) * each + 1] for k in range(bins)]
    return np.array([(e[:-1] + e[1:]).sum() / 2 for e in edges]) * math.tau / (bins * each)
