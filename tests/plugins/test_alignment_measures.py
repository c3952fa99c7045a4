"""What speaks for lines and maps, against plain sums; and the pose that fits a map best."""

import math
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.model import Scene
from sketchmatch_builtin.alignment import Line, Whole, measured, relations_of
from sketchmatch_builtin.alignment._forms import form_distances
from sketchmatch_builtin.alignment._measures import Relations, fit_map
from sketchmatch_builtin.alignment._poses import TOLERANCES
from sketchmatch_builtin.alignment._selves import self_similarities
from sketchmatch_builtin.alignment._things import Things, things_of
from tests.interpreted import examples
from tests.oracle import aligning
from tests.plugins.test_alignment_poses import moved, things
from tests.strategies import random_table, scenes

LINE_RELATED = {"self", "relation", "form"}
WHOLE_RELATED = {"alike", "unlike"}


def some_map(rng, n, m, least=2):
    """Return a map of at least so many objects."""
    count = int(rng.integers(least, min(n, m) + 1))
    partners = np.full(n, -1)
    partners[rng.permutation(n)[:count]] = rng.permutation(m)[:count]
    return partners


def row_of(partners, drawn, mapped, relations=None):
    """Return what is measured of a map, by name."""
    found = measured(np.array([partners]), drawn, mapped, relations)
    return {name.lower(): found.wholes[0, k] for name, k in Whole._asdict().items()}


def lines_of(partners, drawn, mapped, relations=None):
    """Return what is measured of each object of a map, by name."""
    found = measured(np.array([partners]), drawn, mapped, relations)
    np.testing.assert_array_equal(found.matched[0], np.asarray(partners) >= 0)
    return [{name.lower(): row[k] for name, k in Line._asdict().items()} for row in found.lines[0]]


def distorted(rng, n, noise):
    """Return things, and these again, drawn badly and turned."""
    mapped = things(rng, n + 2)
    drawn = moved(mapped, np.arange(n), *(np.exp(complex(*rng.normal(size=2))), 1.0 + 2.0j))
    places = drawn.places + noise * drawn.spacing * (rng.normal(size=n) + 1j * rng.normal(size=n))
    shapes = drawn.shapes + noise * (rng.normal(size=n) + 1j * rng.normal(size=n))
    sizes = drawn.sizes + noise * rng.normal(size=n)
    return Things(places, sizes, shapes, aligning.spacing(places)), mapped


@given(st.integers(0, 2**32), st.integers(2, 7), st.sampled_from([0.0, 0.05, 0.3, 1.0]))
@examples(100)
def test_places_sizes_and_shapes_count_as_plain_sums_say(seed, n, noise):
    rng = np.random.default_rng(seed)
    drawn, mapped = distorted(rng, n, noise)
    partners = np.where(rng.random(n) < 0.7, np.arange(n), -1)
    if rng.random() < 0.5 or np.count_nonzero(partners >= 0) < 2:
        partners = some_map(rng, n, n + 2)
    # Squares of deviations are lost below about 1e-16 of squares of places.
    near = partial(pytest.approx, rel=1e-6, abs=1e-6)
    known = aligning.whole(partners, drawn, mapped, TOLERANCES)
    assert set(known) == {name.lower() for name in Whole._fields} - WHOLE_RELATED
    expected = known | dict.fromkeys(WHOLE_RELATED, 0.0)
    assert row_of(partners, drawn, mapped) == near(expected)
    known = aligning.lines(partners, drawn, mapped, TOLERANCES)
    for i, row in enumerate(lines_of(partners, drawn, mapped)):
        if partners[i] < 0:
            assert set(row.values()) == {0.0}
        else:
            assert set(known[i]) == set(row) - LINE_RELATED
            assert row == near(known[i] | dict.fromkeys(LINE_RELATED, 0.0))


@pytest.mark.parametrize("lines", [0, 1])
def test_fewer_than_two_lines_say_how_many_they_are_and_nothing_else(lines):
    rng = np.random.default_rng(0)
    drawn, mapped = things(rng, 3), things(rng, 4)
    partners = np.array([2, -1, -1]) if lines else np.full(3, -1)
    row = row_of(partners, drawn, mapped)
    assert row.pop("matched") == lines
    assert row.pop("score") == -3.0 * TOLERANCES.omission
    assert set(row.values()) == {0.0}
    assert {value for each in lines_of(partners, drawn, mapped) for value in each.values()} == {0.0}


def test_a_row_that_was_written_before_is_written_anew():
    rng = np.random.default_rng(0)
    drawn, mapped = things(rng, 3), things(rng, 4)
    one, two, three = np.array([0, 1, 2]), np.array([3, -1, 1]), np.array([-1, -1, 0])
    together = measured(np.array([one, two, three, one]), drawn, mapped)
    for k, each in enumerate((one, two, three, one)):
        for several, alone in zip(together, measured(each[None], drawn, mapped), strict=True):
            np.testing.assert_array_equal(several[k], alone[0])


@given(st.integers(0, 2**32), st.integers(2, 6), st.integers(0, 3), st.booleans())
@examples(60)
def test_relations_count_by_what_their_similarities_lack(seed, n, more, swapped):
    rng = np.random.default_rng(seed)
    table = random_table(rng, n, n + more)
    sizes = (n + more, n) if swapped else (n, n + more)
    drawn, mapped = things(rng, sizes[0]), things(rng, sizes[1])
    partners = some_map(rng, *sizes)
    template = partners
    if swapped:
        template = np.full(n, -1)
        template[partners[partners >= 0]] = np.flatnonzero(partners >= 0)
    relations = _bare(*sizes, table.similarity)._replace(swapped=swapped)
    known = aligning.related(template, table)
    for i, row in enumerate(lines_of(partners, drawn, mapped, relations)):
        if partners[i] >= 0:
            expected = known[partners[i] if swapped else i]
            assert row["relation"] == pytest.approx(expected, abs=1e-9)


def _bare(n, m, similarity=None, selves=None, forms=None, names=None):
    """Return relations of which nothing is known but what is given."""
    pairs = n * (n - 1) // 2, m * (m - 1) // 2
    return Relations(
        np.zeros(pairs) if similarity is None else similarity,
        np.zeros((n, m, 4)) if selves is None else selves,
        np.zeros((n, m)) if forms is None else forms,
        np.zeros((n, m), dtype=np.int64) if names is None else names,
        False,
    )


def test_own_histograms_are_read_between_the_bins_of_the_turn():
    rng = np.random.default_rng(0)
    drawn = things(rng, 3)
    selves = rng.uniform(0.2, 1.1, (3, 4, 90))
    names = np.array([[1, -1, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0]])
    relations = _bare(3, 4, selves=selves, names=names)
    for degrees in (0.3, 31.5, 90.0, 178.6, 181.0, 300.2):
        u = 2.0 * np.exp(1j * math.radians(degrees))
        mapped = moved(drawn, np.array([0, 1, 2, 0]), u, 0.0)
        turn = degrees % 180.0 / 2.0
        low = int(turn)
        rest = turn - low
        for i, row in enumerate(lines_of([0, 1, 2], drawn, mapped, relations)):
            alike = (1.0 - rest) * selves[i, i, low % 90] + rest * selves[i, i, (low + 1) % 90]
            assert row["self"] == pytest.approx(max(0.0, 1.0 - alike), abs=1e-6)
        row = row_of([0, 1, 2], drawn, mapped, relations)
        assert (row["alike"], row["unlike"]) == (2.0, 1.0)
        row = row_of([1, -1, 2], drawn, mapped, relations)
        assert (row["alike"], row["unlike"]) == (0.0, 2.0)
        row = row_of([2, 1, 0], drawn, mapped, relations)  # of two of them nothing is said
        assert (row["alike"], row["unlike"]) == (1.0, 0.0)


def test_a_line_is_as_far_from_its_partner_in_form_as_both_are_apart():
    rng = np.random.default_rng(1)
    drawn, mapped = things(rng, 3), things(rng, 4)
    forms = rng.uniform(0.0, 5.0, (3, 4))
    relations = _bare(3, 4, forms=forms)
    for swapped in (False, True):
        found = lines_of([2, -1, 1], drawn, mapped, relations._replace(swapped=swapped))
        assert [row["form"] for row in found] == [forms[0, 2], 0.0, forms[2, 1]]


def assert_finite(partners, drawn, mapped):
    found = measured(partners[None], drawn, mapped)
    assert np.isfinite(found.lines).all()
    assert np.isfinite(found.wholes).all()


def line(*places):
    places = np.array(places, dtype=complex)
    count = len(places)
    return Things(places, np.zeros(count), np.zeros(count, complex), aligning.spacing(places))


def test_what_nobody_drew_amid_others_is_missed():
    corners = line(-1 - 1j, 1 - 1j, 1 + 1j, -1 + 1j)
    centre = line(*corners.places, 0.0)  # its directions leave a gap of a quarter turn
    outside = line(*corners.places, 5.0)  # all of them on one side
    border = line(*corners.places, 1.0)  # between two: half a turn
    edge = line(*corners.places, 0.8)
    for mapped, missing, crowd in (
        (centre, 1.0, 1.0),
        (outside, 0.0, 0.0),
        (border, 0.0, 1.0),
        (edge, 4.0 * math.atan2(0.2, 1.0) / math.pi * 2.0, 1.0),
    ):
        row = row_of([0, 1, 2, 3], corners, mapped)
        assert row["missing"] == pytest.approx(missing, abs=1e-9)
        assert row["crowd"] == crowd
    # Two that were drawn surround nothing.
    assert row_of([0, -1, 2, -1], corners, centre)["missing"] == 0.0
    assert row_of([0, -1, 2, -1], corners, centre)["crowd"] == 0.0


def test_three_near_ones_make_a_crowd():
    corners = line(0.0, 2.0, 1.0 + 1.7j)
    for place, crowd in ((1.0 + 0.6j, 1.0), (1.0 - 2.6j, 0.0)):  # the third is too far from there
        assert row_of([0, 1, 2], corners, line(*corners.places, place))["crowd"] == crowd
        assert row_of([0, 1, -1], corners, line(*corners.places, place))["crowd"] == 0.0


def test_a_stretched_page_bends():
    rng = np.random.default_rng(1)
    drawn = things(rng, 9)
    z = drawn.places - drawn.places.mean()
    flat = moved(drawn, np.arange(9), 1.0 + 0.0j, 0.0)
    stretched = flat._replace(places=z + 0.1 * z.conj())
    scattered = flat._replace(places=z + 0.05 * drawn.spacing * np.exp(7j * rng.random(9)))
    plain, bent, wild = (row_of(np.arange(9), drawn, each) for each in (flat, stretched, scattered))
    assert plain["bend"] == pytest.approx(0.0, abs=1e-9)
    assert bent["bend"] > 0.1
    assert wild["bend"] < 0.1 * bent["bend"]


@given(st.integers(0, 2**32), st.integers(2, 8))
@examples(40)
def test_the_pose_of_a_copy_is_found_exactly(seed, n):
    rng = np.random.default_rng(seed)
    drawn = things(rng, n)
    u = complex(np.exp(complex(rng.uniform(-12.0, 12.0), rng.uniform(0.0, 7.0))))
    t = complex(*rng.normal(0.0, abs(u), 2))
    order = rng.permutation(n)
    mapped = moved(drawn, order, u, t)
    partners = np.argsort(order)
    partners[n // 2 + 2 :] = -1
    v, s, growth, count = fit_map(partners, drawn, mapped, TOLERANCES)
    assert count == np.count_nonzero(partners >= 0)
    assert v / u == pytest.approx(1.0, abs=1e-9)
    assert abs(s - t) <= 1e-8 * abs(u)
    assert growth == pytest.approx(2.0 * math.log(abs(u)), abs=1e-9)


def test_a_map_in_which_nothing_turns_with_anything_shrinks_to_no_point():
    drawn = line(1.0, 1j, -1.0, -1j)
    mapped = line(1.0, -1j, -1.0, 1j)  # mirrored: least squares finds u = 0
    u, _, growth, count = fit_map(np.arange(4), drawn, mapped, TOLERANCES)
    assert abs(u) >= 0.1 - 1e-9
    assert np.isfinite(growth)
    assert count == 4
    assert_finite(np.arange(4), drawn, mapped)


@pytest.mark.parametrize("which", ["drawn", "mapped", "both"])
def test_objects_in_one_place_are_measured_all_the_same(which):
    spread, same = line(0.0, 3.0, 1 + 2j), line(0.0, 0.0, 0.0)._replace(spacing=1e-9)
    drawn = spread if which == "mapped" else same
    mapped = spread if which == "drawn" else same
    u, t, growth, _ = fit_map(np.arange(3), drawn, mapped, TOLERANCES)
    assert (u, growth) == (1.0, 0.0)
    assert t == pytest.approx(mapped.places.mean() - drawn.places.mean())
    assert_finite(np.arange(3), drawn, mapped)


@given(st.integers(0, 2**32), st.integers(3, 5), st.integers(3, 6))
@examples(30)
def test_roles_of_template_and_argument_change_nothing(seed, n, m):
    rng = np.random.default_rng(seed)
    drawn, mapped = things(rng, n), things(rng, m)
    partners = some_map(rng, n, m)
    similarity = rng.normal(size=(n * (n - 1) // 2, m * (m - 1) // 2))
    straight = _bare(n, m, similarity)
    swapped = _bare(n, m, similarity.T.copy())._replace(swapped=True)
    for of in (row_of, lines_of):
        assert of(partners, drawn, mapped, straight) == of(partners, drawn, mapped, swapped)


def test_relations_are_those_of_the_table_and_of_the_objects_alone():
    rng = np.random.default_rng(0)
    box = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
    first = Scene.from_polygons([box, box + np.array((4, 0)), box + np.array((0, 5))])
    second = Scene.from_polygons(
        [box, box + np.array((4, 1)), box + np.array((2, 6)), box + np.array((9, 9))]
    )
    table = random_table(rng, 3, 4)
    found = relations_of((first, second), table, None, False)
    np.testing.assert_array_equal(found.similarity, table.similarity)
    np.testing.assert_array_equal(found.selves, self_similarities(first, second))
    np.testing.assert_array_equal(found.forms, form_distances(first, second))
    np.testing.assert_array_equal(found.names, np.zeros((3, 4)))
    names = rng.integers(-1, 2, (4, 3))
    swapped = relations_of((first, second), table, names, True)
    assert swapped.swapped
    assert not found.swapped
    np.testing.assert_array_equal(swapped.names, names.T)


@given(scenes(least=3, most=5), st.floats(0.0, 6.3), st.sampled_from([1e-6, 1.0, 1e6]))
@examples(30)
def test_turning_scaling_and_mirroring_both_scenes_changes_no_part(scene, turn, scale):
    rng = np.random.default_rng(0)
    other = Scene(tuple(scene.objects[k] for k in rng.permutation(len(scene))))
    one, two = things_of(scene), things_of(other)
    one = one._replace(places=one.places + 0.2 * one.spacing * rng.normal(size=len(scene)))
    partners = some_map(rng, len(scene), len(scene))
    turned = np.exp(1j * turn)
    known, known_lines = row_of(partners, one, two), lines_of(partners, one, two)
    for mirrored in (False, True):
        seen = [
            Things(
                scale * turned * (each.places.conj() if mirrored else each.places) + 3.0 * scale,
                each.sizes + 2.0 * math.log(scale),
                turned**2 * (each.shapes.conj() if mirrored else each.shapes),
                scale * each.spacing,
            )
            for each in (one, two)
        ]
        assert row_of(partners, *seen) == pytest.approx(known, rel=1e-5, abs=1e-5)
        for found, expected in zip(lines_of(partners, *seen), known_lines, strict=True):
            assert found == pytest.approx(expected, rel=1e-5, abs=1e-5)
