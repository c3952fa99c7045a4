"""Poses: what they are worth, which are guessed, and how they are refined."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch_builtin.alignment import _poses
from sketchmatch_builtin.alignment._poses import (
    TOLERANCES,
    empty_guesses,
    far_pairs,
    fitted_pose,
    fitting_pose,
    grid_of,
    grown,
    guess_poses,
    guessed_pose,
    pairing_worths,
    refine_guesses,
    refine_pose,
    vary,
)
from sketchmatch_builtin.alignment._things import Things
from tests.interpreted import examples
from tests.oracle import aligning

ROUGH = TOLERANCES._replace(omission=3.5)
NO_FLOOR = -1e9


def things(rng, count, spread=10.0, places=None):
    """Return objects at random, or in certain places."""
    if places is None:
        places = spread * (rng.uniform(size=count) + 1j * rng.uniform(size=count))
    places = np.asarray(places, dtype=complex)
    shapes = rng.uniform(0.0, 0.5, count) * np.exp(1j * rng.uniform(0.0, 7.0, count))
    spacing = aligning.spacing(places) or 1e-9
    return Things(places, rng.normal(0.0, 0.4, count), shapes, spacing)


def moved(of, order, u, t, growth=None):
    """Return some of these things, seen under a pose."""
    grown_by = 2.0 * math.log(abs(u)) if growth is None else growth
    places = u * of.places[order] + t
    twist = (u / abs(u)) ** 2
    return Things(
        places, of.sizes[order] + grown_by, of.shapes[order] * twist, aligning.spacing(places)
    )


def worth(pose, drawn, mapped, free=None, tolerances=ROUGH, floor=NO_FLOOR):
    """Return what the kernel says a pose is worth."""
    u, t, growth = pose
    grid = grid_of(mapped)
    if free is None:
        free = np.ones((len(drawn.places), len(mapped.places)), dtype=bool)
    twist = u * u / abs(u) ** 2
    sorted_ = np.ascontiguousarray(free[:, grid.order])
    return _poses._worth(u, t, twist, growth, drawn, grid, sorted_, tolerances, floor)


LAYOUTS = {
    "anywhere": lambda rng, n: rng.uniform(size=n) * 9.0 + 9.0j * rng.uniform(size=n),
    "a row": lambda _, n: np.arange(n) + 0.0j,
    "a column": lambda _, n: 1j * np.arange(n),
    "a line": lambda _, n: np.arange(n) * (1.0 + 0.5j),
    "whole numbers": lambda rng, n: rng.integers(0, 4, n) + 1j * rng.integers(0, 4, n),
    "clusters": lambda rng, n: rng.choice([0.0, 500.0 + 3j], n) + rng.normal(size=n),
    "one place": lambda _, n: np.zeros(n, dtype=complex),
}


@pytest.mark.slow
@pytest.mark.parametrize("layout", LAYOUTS)
@given(st.integers(0, 2**32), st.integers(2, 30), st.integers(2, 6))
@examples(40)
def test_the_grid_loses_no_candidate(layout, seed, objects, count):
    rng = np.random.default_rng(seed)
    mapped = things(rng, objects, places=LAYOUTS[layout](rng, objects))
    drawn = things(rng, count)
    free = rng.random((count, objects)) < 0.8
    for _ in range(8):
        scale = math.exp(rng.normal(-0.5, 1.0)) * mapped.spacing / drawn.spacing
        u = scale * np.exp(1j * rng.uniform(0.0, 7.0))
        # Somewhere upon the objects, at their border, or wholly beside them.
        t = mapped.places[rng.integers(objects)] - u * drawn.places[rng.integers(count)]
        t += rng.choice([0.0, 1.0, 30.0]) * mapped.spacing * np.exp(1j * rng.uniform(0.0, 7.0))
        pose = complex(u), complex(t), float(rng.normal(0.0, 0.5))
        assert worth(pose, drawn, mapped, free) == pytest.approx(
            aligning.pose_worth(pose, drawn, mapped, free, ROUGH), abs=1e-9
        )


def test_a_pose_is_worth_no_more_than_its_floor_where_it_is_not_above_it():
    rng = np.random.default_rng(1)
    drawn, mapped = things(rng, 5), things(rng, 9)
    pose = 1.0 + 0.2j, 0.3j, 0.1
    free = np.ones((5, 9), dtype=bool)
    value = aligning.pose_worth(pose, drawn, mapped, free, ROUGH)
    assert worth(pose, drawn, mapped, floor=value + 1e-6) == value + 1e-6
    assert worth(pose, drawn, mapped, floor=value - 1e-6) == pytest.approx(value, abs=1e-9)


@given(st.integers(0, 2**32), st.integers(2, 40))
@examples(40)
def test_each_object_is_in_the_cell_in_which_it_lies(seed, count):
    rng = np.random.default_rng(seed)
    mapped = things(rng, count, places=LAYOUTS[list(LAYOUTS)[seed % len(LAYOUTS)]](rng, count))
    grid = grid_of(mapped)
    assert sorted(grid.order) == list(range(count))
    assert (grid.starts[0], grid.starts[-1]) == (0, count)
    assert max(grid.columns, grid.rows) <= 65
    assert len(grid.starts) == grid.columns * grid.rows + 1
    for cell in range(grid.columns * grid.rows):
        for x in range(grid.starts[cell], grid.starts[cell + 1]):
            place = mapped.places[grid.order[x]]
            assert grid.things.places[x] == place
            assert grid.things.sizes[x] == mapped.sizes[grid.order[x]]
            assert grid.things.shapes[x] == mapped.shapes[grid.order[x]]
            offset = (place - grid.corner) / grid.cell
            assert (int(offset.real), int(offset.imag)) == (
                cell % grid.columns,
                cell // grid.columns,
            )


def guessed(pairs, drawn, mapped, allowed, room=10_000, floor=NO_FLOOR, most=50):
    """Return all that is guessed, and how many were weighed between pauses."""
    found, slices = empty_guesses(room, floor), []
    while found.state[2] < len(pairs) * len(mapped.places):
        before = found.state.copy()
        guess_poses(
            pairs, drawn, mapped, grid_of(mapped), allowed.astype(float), ROUGH, most, found
        )
        assert found.state[2] > before[2]
        slices.append(found.state - before)
    return found, slices


@given(st.integers(0, 2**32), st.integers(2, 4), st.integers(2, 6), st.booleans())
@examples(40)
def test_every_pose_of_two_pairings_is_guessed_once_and_weighed_rightly(seed, n, m, like):
    rng = np.random.default_rng(seed)
    mapped = things(rng, m)
    drawn = things(rng, n)
    if like and n <= m:
        drawn = moved(mapped, rng.permutation(m)[:n], 0.5 - 0.3j, 2.0 + 1.0j)
    allowed = rng.random((n, m)) < 0.9
    pairs = np.array([(a, b) for a in range(n) for b in range(a + 1, n)])
    found, _ = guessed(pairs, drawn, mapped, allowed)
    known = dict(aligning.guesses(pairs, drawn, mapped, allowed))
    count = found.state[0]
    assert found.state[1] == len(known)
    kept = [tuple(pairing) for pairing in found.pairings[:count].tolist()]
    assert sorted(kept) == sorted(known)
    for score, pairing, row in zip(found.scores, kept, found.pairings, strict=False):
        assert score == pytest.approx(
            aligning.pose_worth(known[pairing], drawn, mapped, allowed, ROUGH), abs=1e-9
        )
        np.testing.assert_allclose(guessed_pose(row, drawn, mapped), known[pairing], atol=1e-9)


@pytest.mark.parametrize("room", [2, 4, 10])
def test_the_best_guesses_are_kept_where_there_is_little_room(room):
    rng = np.random.default_rng(room)
    mapped = things(rng, 9)
    drawn = moved(mapped, rng.permutation(9)[:4], 2.0j, 1.0)
    pairs = np.array([(a, b) for a in range(4) for b in range(a + 1, 4)])
    allowed = np.ones((4, 9), dtype=bool)
    floor = -0.8 * ROUGH.omission * 4
    found, _ = guessed(pairs, drawn, mapped, allowed, room=room, floor=floor)
    values = sorted(
        (
            aligning.pose_worth(pose, drawn, mapped, allowed, ROUGH)
            for _, pose in aligning.guesses(pairs, drawn, mapped, allowed)
        ),
        reverse=True,
    )
    best = [value for value in values if value > floor][: room // 2]
    kept = np.sort(found.scores[: found.state[0]])[::-1]
    np.testing.assert_allclose(kept[: len(best)], best, atol=1e-9)
    assert found.state[0] < room


def test_a_floor_keeps_what_is_not_worth_more_out():
    rng = np.random.default_rng(5)
    mapped, drawn = things(rng, 6), things(rng, 3)
    pairs, allowed = np.array([(0, 1), (1, 2)]), np.ones((3, 6), dtype=bool)
    values = sorted(
        aligning.pose_worth(pose, drawn, mapped, allowed, ROUGH)
        for _, pose in aligning.guesses(pairs, drawn, mapped, allowed)
    )
    floor = (values[-4] + values[-3]) / 2.0
    found, _ = guessed(pairs, drawn, mapped, allowed, floor=floor)
    assert 0 < found.state[0] == sum(value > floor for value in values)
    assert found.state[1] == len(values)


def test_once_there_is_no_room_only_better_guesses_are_kept():
    rng = np.random.default_rng(5)
    mapped, drawn = things(rng, 6), things(rng, 3)
    pairs, allowed = np.array([(0, 1), (1, 2)]), np.ones((3, 6), dtype=bool)
    found, _ = guessed(pairs, drawn, mapped, allowed, room=4)
    values = sorted(
        aligning.pose_worth(pose, drawn, mapped, allowed, ROUGH)
        for _, pose in aligning.guesses(pairs, drawn, mapped, allowed)
    )
    assert len(values) > 8
    # The second best when the room was last full: at most one that is better came after.
    assert values[-3] - 1e-9 <= found.floor[0] <= values[-2] + 1e-9
    assert found.scores[: found.state[0]].min() >= found.floor[0]


def test_guessing_pauses_soon_however_few_poses_there_are():
    rng = np.random.default_rng(0)
    drawn = things(rng, 3)
    mapped = things(rng, 200)
    mapped = mapped._replace(sizes=2.0 * np.arange(200.0))  # no two pairings ever agree
    pairs, allowed = np.array([(0, 1), (0, 2), (1, 2)]), np.ones((3, 200), dtype=bool)
    found, slices = guessed(pairs, drawn, mapped, allowed, most=1)
    assert found.state[1] == 0
    looks = max(1, _poses._LOOKS // 200)
    assert max(done for _, _, done in slices) <= looks
    assert len(slices) == math.ceil(600 / looks)


def test_guessing_pauses_after_as_many_as_it_may_weigh_or_those_of_one_more_pairing():
    rng = np.random.default_rng(0)
    mapped = things(rng, 30)._replace(sizes=np.zeros(30))
    drawn = moved(mapped, np.arange(4), 1.0 + 0.0j, 0.0)
    pairs, allowed = np.array([(0, 1), (2, 3)]), np.ones((4, 30), dtype=bool)
    found, slices = guessed(pairs, drawn, mapped, allowed, most=40)
    assert found.state[1] > 200
    assert max(weighed for _, weighed, _ in slices) < 40 + 30


@given(st.integers(0, 2**32), st.integers(1, 4), st.integers(1, 5))
@examples(40)
def test_worths_are_logarithms_of_students_t(seed, n, m):
    rng = np.random.default_rng(seed)
    drawn, mapped = things(rng, n + 1), things(rng, m + 1)
    pose = complex(rng.normal(), rng.normal() + 3.0), complex(*rng.normal(size=2)), rng.normal()
    bonus = rng.normal(size=(n + 1, m + 1))
    bonus[0, 0] = -np.inf
    np.testing.assert_allclose(
        pairing_worths(*pose, drawn, mapped, bonus, TOLERANCES),
        aligning.worths(pose, drawn, mapped, TOLERANCES, bonus),
        atol=1e-9,
    )


@given(st.integers(0, 2**32), st.integers(2, 4), st.integers(2, 4))
@examples(40)
def test_a_refined_pose_holds_the_best_of_all_maps_under_it(seed, n, m):
    rng = np.random.default_rng(seed)
    drawn, mapped = things(rng, n), things(rng, m)
    bonus = np.where(rng.random((n, m)) < 0.2, rng.choice([-np.inf, 2.0, -2.0], (n, m)), 0.0)
    start = complex(*rng.normal(size=2)) + 1.5, complex(*rng.normal(size=2)), 0.2
    partners = np.empty(n, dtype=np.int64)
    *pose, score = refine_pose(*start, drawn, mapped, bonus, TOLERANCES, partners)
    found = aligning.worths(pose, drawn, mapped, TOLERANCES, bonus)
    best = max(aligning.value(each, found, TOLERANCES.omission) for each in aligning.all_maps(n, m))
    assert score == pytest.approx(best, abs=1e-8)
    assert aligning.value(partners, found, TOLERANCES.omission) == pytest.approx(best, abs=1e-8)


def test_several_guesses_are_refined_as_each_alone():
    rng = np.random.default_rng(4)
    drawn, mapped, bonus = things(rng, 5), things(rng, 7), rng.normal(size=(5, 7))
    pairings = np.array([[0, j, 3, g] for j in range(7) for g in range(7) if j != g])
    partners = np.empty((len(pairings), 5), dtype=np.int64)
    poses, values = np.empty((len(pairings), 2), dtype=complex), np.empty((len(pairings), 2))
    refine_guesses(pairings, drawn, mapped, bonus, TOLERANCES, partners, poses, values)
    alone = np.empty(5, dtype=np.int64)
    for k, pairing in enumerate(pairings):
        start = guessed_pose(pairing, drawn, mapped)
        known = refine_pose(*start, drawn, mapped, bonus, TOLERANCES, alone)
        assert (*poses[k].tolist(), *values[k].tolist()) == known
        np.testing.assert_array_equal(partners[k], alone)


@given(st.integers(0, 2**32), st.integers(2, 7), st.integers(0, 30))
@examples(40)
def test_far_pairs_come_first_and_each_place_soon(seed, n, most):
    places = things(np.random.default_rng(seed), n).places
    left, used = list(itertools.combinations(range(n), 2)), [0] * n
    found = far_pairs(places, most).tolist()
    assert len(found) == min(len(left), most)
    for a, b in found:
        worth = {(i, j): abs(places[i] - places[j]) / (1 + used[i] + used[j]) for i, j in left}
        assert worth[a, b] == pytest.approx(max(worth.values()))
        left.remove((a, b))
        used[a] += 1
        used[b] += 1


def test_refining_finds_a_copy_from_a_pose_that_is_a_little_off():
    rng = np.random.default_rng(3)
    mapped = things(rng, 8)
    order = rng.permutation(8)[:6]
    u, t = 0.7 - 0.4j, 3.0 + 1.0j
    drawn = moved(mapped, order, 1.0 / u, -t / u)
    partners = np.empty(6, dtype=np.int64)
    v, s, growth, score = refine_pose(
        u * np.exp(0.05j), t + 0.1, 0.0, drawn, mapped, np.zeros((6, 8)), TOLERANCES, partners
    )
    np.testing.assert_array_equal(partners, order)
    assert v == pytest.approx(u, abs=1e-9)
    assert s == pytest.approx(t, abs=1e-9)
    assert growth == pytest.approx(2.0 * math.log(abs(u)), abs=1e-9)
    assert score == pytest.approx(0.0, abs=1e-8)


def test_a_pinned_pairing_is_kept_whatever_speaks_against_it():
    rng = np.random.default_rng(3)
    mapped = things(rng, 5)
    drawn = moved(mapped, np.arange(4), 1.0 + 0.0j, 0.0)
    bonus = np.zeros((4, 5))
    bonus[0], bonus[:, 4] = -np.inf, -np.inf
    bonus[0, 4] = 50.0
    partners = np.empty(4, dtype=np.int64)
    refine_pose(1.0 + 0.0j, 0.0j, 0.0, drawn, mapped, bonus, TOLERANCES, partners)
    np.testing.assert_array_equal(partners, [4, 1, 2, 3])


@given(st.integers(0, 2**32), st.integers(2, 7))
@examples(40)
def test_the_pose_of_an_exact_copy_is_fitted_exactly(seed, n):
    rng = np.random.default_rng(seed)
    drawn = things(rng, n)
    u = np.exp(complex(rng.uniform(-12.0, 12.0), rng.uniform(0.0, 7.0)))
    t = complex(*rng.normal(0.0, abs(u), 2))
    mapped = moved(drawn, np.arange(n), u, t)
    partners = np.where(np.arange(n) < max(2, n - 1), np.arange(n), -1)
    first = u * np.exp(0.1j), t + 0.1 * abs(u)
    v, s = fitted_pose(*first, drawn, mapped, TOLERANCES, partners)
    assert v / u == pytest.approx(1.0, abs=1e-7)
    assert abs(s - t) <= 1e-7 * abs(u) * 10.0


def test_a_line_that_is_far_off_hardly_moves_the_pose():
    rng = np.random.default_rng(2)
    drawn = things(rng, 8)
    mapped = moved(drawn, np.arange(8), 1.0 + 0.0j, 0.0)
    mapped.places[0] += 50.0 * drawn.spacing
    u, t = fitted_pose(1.0 + 0.0j, 0.0j, drawn, mapped, TOLERANCES, np.arange(8))
    assert abs(u - 1.0) < 0.01
    share = 1.0 / (1.0 + (50.0 / 0.35) ** 2 / 3.0)
    middle = np.average(drawn.places, weights=[share, *[1.0] * 7])
    assert u * middle + t == pytest.approx(
        np.average(mapped.places, weights=[share, *[1.0] * 7]), abs=1e-9
    )


@given(st.integers(0, 2**32), st.integers(2, 6), st.integers(0, 3))
@examples(40)
def test_a_pose_is_fitted_by_squares_each_weighed_by_how_well_it_fits(seed, n, more):
    rng = np.random.default_rng(seed)
    drawn, mapped = things(rng, n), things(rng, n + more)
    partners = rng.permutation(n + more)[:n]
    partners[2 + rng.integers(n - 1) :] = -1
    partners = rng.permutation(partners)
    u, t = complex(1.0 + rng.random(), rng.normal()), complex(*rng.normal(size=2))
    matched = np.flatnonzero(partners >= 0)
    here, there = drawn.places[matched], mapped.places[partners[matched]]
    unit = 3.0 * abs(u) ** 2 * (TOLERANCES.place * drawn.spacing) ** 2
    known = np.stack([here, np.ones(len(here))], axis=1)
    roots = np.sqrt(1.0 / (1.0 + abs(there - u * here - t) ** 2 / unit))
    (v, s), *_ = np.linalg.lstsq(roots[:, None] * known, roots * there)
    found = fitted_pose(u, t, drawn, mapped, TOLERANCES, partners)
    assert found == (pytest.approx(v, abs=1e-7), pytest.approx(s, abs=1e-7 * (1.0 + abs(s))))


@pytest.mark.parametrize("partners", [[-1, -1, -1], [0, -1, -1]])
def test_fewer_than_two_lines_fit_no_pose(partners):
    drawn = things(np.random.default_rng(0), 3)
    assert fitted_pose(1.0 + 0j, 0j, drawn, drawn, TOLERANCES, np.array(partners)) == (0.0, 0.0)


def test_objects_in_one_place_fit_no_pose():
    rng = np.random.default_rng(0)
    flat = things(rng, 3, places=np.zeros(3))
    spread = things(rng, 3)
    assert fitted_pose(1.0 + 0j, 0j, flat, spread, TOLERANCES, np.arange(3)) == (0.0, 0.0)
    assert fitted_pose(1.0 + 0j, 0j, spread, flat, TOLERANCES, np.arange(3)) == (0.0, 0.0)


@given(st.integers(0, 2**32), st.integers(2, 6), st.integers(0, 3))
@examples(40)
def test_the_pose_of_a_map_lays_its_objects_with_the_least_squares(seed, n, more):
    rng = np.random.default_rng(seed)
    drawn, mapped = things(rng, n), things(rng, n + more)
    partners = rng.permutation(n + more)[:n]
    partners[2 + rng.integers(n - 1) :] = -1
    partners = rng.permutation(partners)
    matched = np.flatnonzero(partners >= 0)
    known = np.stack([drawn.places[matched], np.ones(len(matched))], axis=1)
    (v, s), *_ = np.linalg.lstsq(known, mapped.places[partners[matched]])
    u, t, growth = fitting_pose(partners, drawn, mapped)
    assert u == pytest.approx(v, abs=1e-9)
    assert t == pytest.approx(s, abs=1e-9 * (1.0 + abs(s)))
    assert growth == grown(drawn, mapped, partners, 2.0 * math.log(abs(u)), TOLERANCES)


def test_a_map_tells_of_no_pose_where_it_has_one_line_or_all_in_one_place():
    rng = np.random.default_rng(0)
    drawn, flat = things(rng, 3), things(rng, 3, places=np.zeros(3))
    for partners in ([-1, -1, -1], [0, -1, -1]):
        assert fitting_pose(np.array(partners), drawn, drawn) is None
    assert fitting_pose(np.arange(3), drawn, flat) is None
    assert fitting_pose(np.arange(3), flat, drawn) is None


def test_sizes_grow_with_the_pose_unless_things_say_otherwise():
    rng = np.random.default_rng(0)
    drawn = things(rng, 6)
    mapped = drawn._replace(sizes=drawn.sizes + 1.0)
    found = grown(drawn, mapped, np.arange(6), 0.4, TOLERANCES)
    offset = 0.0
    for _ in range(3):
        share = 1.0 / (1.0 + ((0.6 - offset) / 0.35) ** 2 / 3.0)
        offset = 6.0 * share * 0.6 / (6.0 * share + (0.35 / 0.6) ** 2)
    assert found == pytest.approx(0.4 + offset)
    assert grown(drawn, mapped, np.full(6, -1), 0.4, TOLERANCES) == 0.4


@given(st.integers(0, 2**32), st.integers(1, 5), st.integers(1, 5))
@examples(60)
def test_every_single_change_is_made_once_at_its_loss(seed, n, m):
    rng = np.random.default_rng(seed)
    worths = rng.normal(-3.0, 3.0, (n, m))
    worths[rng.random((n, m)) < 0.15] = -np.inf
    partners = np.full(n, -1)
    for i, j in zip(rng.permutation(n), rng.permutation(m), strict=False):
        if rng.random() < 0.8 and np.isfinite(worths[i, j]):
            partners[i] = j
    limit = float(rng.uniform(0.0, 12.0))
    maps, losses = np.empty((2000, n), dtype=np.int64), np.empty(2000)
    count = vary(worths, 5.0, partners, limit, maps, losses)
    now = aligning.value(partners, worths, 5.0)
    known = {
        each: now - value
        for each in aligning.changed(partners, n, m)
        if np.isfinite(value := aligning.value(each, worths, 5.0))
    }
    found = [tuple(each) for each in maps[:count].tolist()]
    assert len(set(found)) == len(found)
    for each, loss in zip(found, losses, strict=False):
        assert loss == pytest.approx(known[each], abs=1e-9)
    assert set(found) == {each for each, loss in known.items() if loss <= limit}


def test_changes_end_where_there_is_no_more_room():
    worths, partners = np.zeros((5, 6)), np.array([0, 1, 2, -1, -1])
    maps, losses = np.full((8, 5), -9), np.full(7, np.nan)
    assert vary(worths, 1.0, partners, 99.0, maps, losses) == 7
    assert (maps[7] == -9).all()
    assert np.isfinite(losses).all()


@given(st.lists(st.sampled_from([-1.0, 0.0, 0.5, 0.5000001, 3.0]), max_size=70))
@examples(200)
def test_guesses_are_ranked_as_a_stable_sort_does(scores):
    values = np.array(scores, dtype=float)
    expected = np.argsort(-values, kind="stable")
    np.testing.assert_array_equal(_poses._ranked(values), expected)
