"""Relations in words: the degrees against their definition, their symmetries, scenes by hand."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sketchmatch import InvalidInputError, Scene, directional_relation, force_histogram
from sketchmatch.errors import Reason
from sketchmatch.model import SceneDescriptor, object_pairs
from sketchmatch.pipeline.words import (
    NO_DIRECTION,
    PHRASES,
    directional_degrees,
    directional_relations,
    nearest_relations,
)
from tests.interpreted import examples
from tests.oracle.directions import degree as by_definition

TURNS = math.pi / 4 * np.arange(8.0)
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


@st.composite
def histograms(draw, counts=(4, 8, 16, 36, 64, 180)):
    """Return a histogram: a few lobes of any width, or noise, with stretches of zero."""
    bins = draw(st.sampled_from(counts))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    angles = 2 * np.pi * np.arange(bins) / bins
    row = np.zeros(bins)
    for _ in range(draw(st.integers(0, 3))):
        apart = np.abs(np.remainder(angles - rng.uniform(0, 7) + np.pi, 2 * np.pi) - np.pi)
        row += rng.uniform(0.1, 1) * np.maximum(0, 1 - apart / rng.uniform(0.05, 3))
    row += draw(st.sampled_from([0.0, 0.0, 0.3])) * rng.uniform(0, 1, bins)
    assume(row.any())
    return row


def degrees(row, turns=TURNS):
    return directional_degrees(np.atleast_2d(row), np.atleast_1d(turns))[0]


def small_and_far(angle, bins=360):
    """Return the histogram of a small far object, its whole force at one angle."""
    row = np.zeros(bins)
    place = angle * bins / math.tau
    low = math.floor(place)
    row[low % bins] = 1 - (place - low)
    row[(low + 1) % bins] += place - low
    return row


@given(histograms(counts=(4, 8, 12, 36)), st.floats(-7.0, 7.0))
@examples(25)
def test_degrees_are_those_of_the_definition(row, direction):
    assert degrees(row, direction)[0] == pytest.approx(by_definition(row, direction), abs=2e-3)


@given(histograms())
def test_degrees_are_within_0_and_1_and_the_relation_has_the_highest(row):
    found = degrees(row)
    assert ((found >= 0) & (found <= 1)).all()
    relation = directional_relation(row)
    assert relation.degree == pytest.approx(found.max(), abs=1e-9)
    if relation.degree < 0.3:
        assert (relation.phrase, relation.direction) == (NO_DIRECTION, None)
    else:
        eighth = round(relation.direction / (math.pi / 4)) % 8
        assert relation.phrase == PHRASES[eighth]
        assert -math.pi < relation.direction <= math.pi


def clear(row):
    """Whether one direction is better than the others by more than rounding."""
    first, second = sorted(degrees(row))[:-3:-1]
    return first - second > 1e-6 and abs(first - 0.3) > 1e-6


@given(histograms(counts=(8, 16, 64, 360)), st.integers(0, 7))
def test_turning_by_eighths_turns_the_relation(row, eighths):
    turned = np.roll(row, eighths * len(row) // 8)
    np.testing.assert_allclose(degrees(turned), np.roll(degrees(row), eighths), atol=1e-12)
    assume(clear(row))
    before, after = directional_relation(row), directional_relation(turned)
    assert after.degree == pytest.approx(before.degree, abs=1e-12)
    if before.direction is None:
        assert after.phrase == NO_DIRECTION
    else:
        assert after.phrase == PHRASES[(PHRASES.index(before.phrase) + eighths) % 8]


@given(histograms())
def test_the_mirror_image_has_the_mirrored_relation(row):
    mirrored = row[-np.arange(len(row)) % len(row)]
    np.testing.assert_allclose(degrees(mirrored), degrees(row)[-np.arange(8) % 8], atol=1e-12)
    upright = directional_relation(row)
    if clear(row):
        swapped = upright.phrase.replace("above", "?").replace("below", "above")
        assert directional_relation(mirrored).phrase == swapped.replace("?", "below")


@given(histograms())
def test_the_dual_has_the_opposite_phrase_and_the_same_degree(row):
    there, back = directional_relation(row), directional_relation(np.roll(row, len(row) // 2))
    assert back.degree == pytest.approx(there.degree, abs=1e-12)
    if clear(row) and there.direction is not None:
        assert PHRASES.index(back.phrase) == (PHRASES.index(there.phrase) + 4) % 8


@given(histograms(), st.sampled_from([1e-300, 1e-9, 3.0, 1e300]))
def test_scale_does_not_matter(row, factor):
    np.testing.assert_allclose(degrees(factor * row), degrees(row), atol=1e-12)


@given(histograms(), st.floats(-4.0, 4.0), st.integers(0, 10**9))
def test_degrees_change_continuously(row, direction, seed):
    noise = np.random.default_rng(seed).uniform(0, 1e-7, len(row)) * row.max()
    here = degrees(row, direction)[0]
    # At most all forces of one bin's width are ahead, behind or on the other side after a step.
    assert degrees(row, direction + 1e-7)[0] == pytest.approx(here, abs=2e-7 * len(row))
    assert degrees(row + noise, direction)[0] == pytest.approx(here, abs=2e-7 * len(row))


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.234, -2.0, math.pi])
def test_a_small_far_object_has_degree_1_ahead_and_none_beyond_a_right_angle(angle):
    row = small_and_far(angle)
    for off in (0.0, 0.1, math.pi / 4, 1.5):
        for sign in (1, -1):
            expected = pytest.approx(1 - 2 * off / math.pi, abs=0.01)
            assert degrees(row, angle + sign * off)[0] == expected
    for off in (math.pi / 2 + 0.02, 2.0, math.pi):
        assert degrees(row, angle + off)[0] == degrees(row, angle - off)[0] == 0.0


def test_a_bin_across_a_boundary_counts_half_on_each_side():
    ahead, across, behind = (np.eye(8)[k] for k in (0, 2, 4))
    assert degrees(ahead, 0.0)[0] == 1.0
    assert degrees(across, 0.0)[0] == 0.0, "one half of it compensates the other"
    assert degrees(behind, 0.0)[0] == 0.0
    assert degrees(ahead + behind, 0.0)[0] == 0.0, "half of it on each side"


def square(x, y, side=1.0):
    return side * SQUARE + [x, y]


@pytest.mark.parametrize(
    ("x", "y", "phrase"),
    [
        (3, 0, "to the right of"),
        (4, 4, "to the right of and above"),
        (0, 3, "above"),
        (-4, 4, "to the left of and above"),
        (-3, 0, "to the left of"),
        (-4, -4, "to the left of and below"),
        (0, -3, "below"),
        (4, -4, "to the right of and below"),
    ],
)
@pytest.mark.parametrize("directions", [180, 36, 720])
def test_unit_squares_beside_each_other(x, y, phrase, directions):
    row = force_histogram(square(x, y), SQUARE, directions=directions)
    relation = directional_relation(row)
    assert relation.phrase == phrase
    assert relation.degree > 0.9
    assert relation.direction == pytest.approx(math.atan2(y, x))


def test_a_ring_around_a_square_has_no_clear_direction():
    ring = [square(-3, -3, 7.0), square(-2, -2, 5.0)]
    for pair in ((ring, SQUARE), (SQUARE, ring)):
        relation = directional_relation(force_histogram(*pair))
        assert relation.phrase == NO_DIRECTION
        assert relation.degree == pytest.approx(0.0, abs=1e-9)


def test_a_horseshoe_is_where_its_arch_is():
    horseshoe = [(-3, -3), (4, -3), (4, 1), (3, 1), (3, -2), (-2, -2), (-2, 1), (-3, 1)]
    relation = directional_relation(force_histogram(horseshoe, SQUARE))
    assert relation.phrase == "below"
    assert 0.3 < relation.degree < 0.9


def test_nothing_at_all_has_no_clear_direction():
    relation = directional_relation(np.zeros(180))
    assert (relation.phrase, relation.degree, relation.direction) == (NO_DIRECTION, 0.0, None)


def test_of_equal_directions_the_plain_one_wins():
    row = small_and_far(math.pi / 8, 16)
    assert degrees(row)[0] == pytest.approx(degrees(row)[1])
    assert directional_relation(row).phrase == "to the right of"
    assert directional_relation(np.roll(row, 2)).phrase == "above"


def test_many_rows_are_as_each_alone():
    rows = np.random.default_rng(0).uniform(0, 1, (5000, 8)) ** 4
    found = directional_relations(rows)
    assert len(found) == 5000
    assert found[4321] == directional_relation(rows[4321])


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ([1.0, 2.0, 3.0], r"has shape \(3,\); give one number for each of an even count"),
        ([1.0, 2.0], "4 or more"),
        (np.zeros((2, 8)), r"has shape \(2, 8\)"),
        ([1.0, -1.0, 0.0, 0.0], "has values that are negative"),
        ([1.0, math.nan, 0.0, 0.0], "or not finite"),
        ([1.0, 1j, 0.0, 0.0], r"give a list of real numbers"),
        ("abcd", "is 'abcd'; give a list of real numbers"),
        ([[1.0, 2.0], [3.0]], "give a list of real numbers"),
    ],
)
def test_what_is_no_histogram_is_refused(row, words):
    with pytest.raises(InvalidInputError, match=words) as caught:
        directional_relation(row)
    assert (caught.value.reason, caught.value.field) == (Reason.INVALID_PARAMETER, "histogram")


def test_no_rounding_lifts_a_degree_above_1():
    assert degrees([1.0, 0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.4], 0.0) == [1.0]


# The nearest other object --------------------------------------------------------------------


def described(*polygons):
    scene = Scene.from_polygons(polygons)
    rows = [force_histogram(*(scene.objects[k] for k in pair)) for pair in object_pairs(len(scene))]
    return scene, SceneDescriptor(np.array(rows), len(scene), 0.0)


def test_each_object_is_related_to_the_nearest_other():
    scene, descriptor = described(square(0, 0), square(3, 0), square(3, 10), square(0.5, 12))
    found = nearest_relations(scene, descriptor, range(4))
    assert {k: (item.reference_object, item.phrase) for k, item in found.items()} == {
        0: (1, "to the left of"),
        1: (0, "to the right of"),
        2: (3, "to the right of and below"),
        3: (2, "to the left of and above"),
    }
    for k, item in found.items():
        relation = directional_relation(descriptor.histogram(k, item.reference_object))
        assert item.degree == pytest.approx(relation.degree, abs=1e-12)


def test_objects_without_a_partner_are_passed_over():
    scene, descriptor = described(square(0, 0), square(3, 0), square(3, 10), square(0.5, 12))
    found = nearest_relations(scene, descriptor, [2, 0])
    assert {k: item.reference_object for k, item in found.items()} == {0: 2, 2: 0}
    assert nearest_relations(scene, descriptor, [2]) == {}


def test_of_equally_near_objects_the_lower_index_is_the_reference():
    scene, descriptor = described(square(0, 3), square(0, -3), square(-3, 0), square(0, 0))
    assert nearest_relations(scene, descriptor, range(4))[3].reference_object == 0


def test_touching_overlapping_and_equal_objects_are_nearest():
    scene, descriptor = described(SQUARE, square(1, 0), SQUARE, square(0.5, 5), square(0, 6.5))
    found = nearest_relations(scene, descriptor, range(5))
    references = {k: item.reference_object for k, item in found.items()}
    assert references == {0: 1, 1: 0, 2: 0, 3: 4, 4: 3}
    assert found[2].phrase == NO_DIRECTION


@given(st.integers(0, 10**6), st.sampled_from([2, 3, 7, 12, 24, 25, 31]))
@examples(25)
def test_the_nearest_is_the_one_at_the_smallest_distance(seed, count):
    rng = np.random.default_rng(seed)
    scene = Scene.from_polygons(
        [square(*rng.integers(0, 12, 2), rng.integers(1, 4)) for _ in range(count)]
    )
    descriptor = SceneDescriptor(np.ones((count * (count - 1) // 2, 4)), count, 0.0)
    found = nearest_relations(scene, descriptor, range(count))
    distance = {
        (a, b): scene.objects[a].polygon.distance(scene.objects[b].polygon)
        for a, b in itertools.permutations(range(count), 2)
    }
    for a in range(count):
        others = [b for b in range(count) if b != a]
        assert found[a].reference_object == min(others, key=lambda b: (distance[a, b], b))
