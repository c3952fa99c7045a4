"""The maps that poses lead to: complete or not, single changes among them."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch_builtin.alignment import (
    Laid,
    Sides,
    completed,
    drive,
    known_maps,
    laid_maps,
    near_maps,
    template_maps,
)
from sketchmatch_builtin.alignment import _candidates as module
from sketchmatch_builtin.alignment._poses import TOLERANCES
from tests.interpreted import examples
from tests.oracle import aligning
from tests.plugins.test_alignment_poses import moved, things


def sides(drawn, mapped, bonus=None, swapped=False):
    shape = len(drawn.places), len(mapped.places)
    return Sides(drawn, mapped, np.zeros(shape) if bonus is None else bonus, swapped)


def copied(seed, drawn, objects):
    """Return a copy of some of what is there, and which it is."""
    rng = np.random.default_rng(seed)
    mapped = things(rng, objects)
    order = rng.permutation(objects)[:drawn]
    return moved(mapped, order, 0.5 - 0.7j, 2.0 - 1.0j), mapped, order


def lay(seen, poses=60, maps=120, partial=True):
    return drive(laid_maps(seen, poses, maps, partial))


@pytest.mark.parametrize("swapped", [False, True])
@given(st.integers(0, 2**32), st.integers(2, 4), st.integers(0, 2))
@examples(40)
def test_a_map_is_completed_at_the_least_loss(swapped, seed, rows, more):
    rng = np.random.default_rng(seed)
    shape = (rows + more, rows) if swapped else (rows, rows + more)
    bonus = np.where(rng.random(shape) < 0.1, -np.inf, rng.choice([0.0, 2.0, -2.0, 50.0], shape))
    seen = sides(things(rng, shape[0]), things(rng, shape[1]), bonus, swapped)
    pose = complex(rng.normal() + 1.0, rng.normal()), complex(*rng.normal(size=2)), 0.0
    for laid in (None, Laid(np.full(shape[0], -1), pose, 0.0)):
        worths = bonus
        if laid is not None:
            worths = aligning.worths(pose, seen.drawn, seen.mapped, TOLERANCES, bonus)
        worths = worths.T if swapped else worths
        # What is worth much less than the best of an object is worth no less than that.
        best = np.maximum(worths.max(axis=1, keepdims=True), -1e9)
        lacks = np.where(np.isfinite(worths), np.minimum(best - worths, 20.0), np.inf)
        ways = [np.array(way) for way in itertools.permutations(range(rows + more), rows)]
        costs = [lacks[np.arange(rows), way].sum() for way in ways]
        found = completed(laid, seen)
        if np.isfinite(min(costs)):
            assert lacks[np.arange(rows), found].sum() == pytest.approx(min(costs), abs=1e-9)
        assert len(set(found.tolist())) == rows


def test_where_something_is_pinned_the_others_are_completed_by_what_fits():
    drawn, mapped, order = copied(0, 5, 7)
    bonus = np.zeros((5, 7))
    bonus[0], bonus[:, order[0]] = -np.inf, -np.inf
    bonus[0, order[0]] = 50.0
    u, t = 0.5 - 0.7j, 2.0 - 1.0j
    pose = 1.0 / u, -t / u, 0.0
    np.testing.assert_array_equal(
        completed(Laid(np.full(5, -1), pose, 0.0), sides(drawn, mapped, bonus)), order
    )


def test_where_no_complete_map_is_allowed_one_is_returned_all_the_same():
    drawn, mapped, _ = copied(0, 3, 4)
    bonus = np.zeros((3, 4))
    bonus[1] = -np.inf
    assert completed(None, sides(drawn, mapped, bonus)).tolist() == [0, 1, 2]


@pytest.mark.parametrize("partial", [True, False])
@given(st.integers(0, 2**32), st.integers(2, 7), st.integers(0, 5))
@examples(40)
def test_a_copy_is_laid_wholly_and_exactly(partial, seed, count, more):
    drawn, mapped, order = copied(seed, count, count + more)
    best, *_ = lay(sides(drawn, mapped), partial=partial)
    if count > 2:
        np.testing.assert_array_equal(best.partners, order)
        u, t, _ = best.pose
        np.testing.assert_allclose(u * drawn.places + t, mapped.places[order], atol=1e-6)
    assert best.score == pytest.approx(0.0, abs=1e-6)


@given(st.integers(0, 2**32), st.integers(2, 5), st.integers(2, 6), st.booleans(), st.booleans())
@examples(60)
def test_what_is_laid_is_valid_different_allowed_and_rightly_scored(seed, n, m, partial, ruled):
    rng = np.random.default_rng(seed)
    drawn, mapped = things(rng, n), things(rng, m)
    if n <= m:
        drawn = moved(mapped, rng.permutation(m)[:n], 2.0j, 1.0)
        drawn = drawn._replace(places=drawn.places + 0.1 * drawn.spacing * rng.normal(size=n))
    bonus = np.where(rng.random((n, m)) < 0.2, -np.inf, 0.0) if ruled else np.zeros((n, m))
    seen = sides(drawn, mapped, bonus, swapped=n > m)
    laid = lay(seen, maps=40, partial=partial)
    assert len({each.partners.tobytes() for each in laid}) == len(laid) <= 40
    scores = [each.score for each in laid]
    assert scores == sorted(scores, reverse=True)
    fewest = min(3, n, m) if partial else min(n, m)
    complete = [way for way in aligning.all_maps(n, m) if sum(j >= 0 for j in way) == min(n, m)]
    possible = any(
        all(np.isfinite(bonus[i, j]) for i, j in enumerate(way) if j >= 0) for way in complete
    )
    for each in laid:
        matched = np.flatnonzero(each.partners >= 0)
        assert len(set(each.partners[matched])) == len(matched) >= fewest
        if partial or possible:
            assert np.isfinite(bonus[matched, each.partners[matched]]).all()
            found = aligning.worths(each.pose, drawn, mapped, TOLERANCES, bonus)
            value = aligning.value(each.partners, found, TOLERANCES.omission)
            assert each.score == pytest.approx(value, abs=1e-6)


def test_single_changes_of_the_best_map_are_offered_as_well():
    drawn, mapped, order = copied(4, 5, 6)
    laid = lay(sides(drawn, mapped), poses=1, maps=500)
    offered = {tuple(each.partners.tolist()) for each in laid}
    found = aligning.worths(laid[0].pose, drawn, mapped, TOLERANCES)
    best = aligning.value(order, found, TOLERANCES.omission)
    near = {
        each
        for each in aligning.changed(order, 5, 6)
        if best - aligning.value(each, found, TOLERANCES.omission) <= 9.0
        and sum(j >= 0 for j in each) >= 3
    }
    assert offered == near | {tuple(order.tolist())}
    # The best of these, where fewer are wanted.
    few = lay(sides(drawn, mapped), poses=1, maps=4)
    assert [each.score for each in few] == [each.score for each in laid[:4]]


def test_maps_of_the_template_are_those_of_the_sketch_the_other_way_round():
    drawn, mapped, order = copied(1, 4, 6)
    straight = template_maps(lay(sides(drawn, mapped)), sides(drawn, mapped))
    np.testing.assert_array_equal(straight[0], order)
    # The map has fewer objects than the sketch, so the map is the template.
    other = sides(mapped, drawn, swapped=True)
    swapped = template_maps(lay(other), other)
    np.testing.assert_array_equal(swapped[0], order)


@pytest.mark.parametrize("partial", [True, False])
def test_nothing_is_laid_where_all_lies_in_one_place(partial):
    rng = np.random.default_rng(0)
    drawn = things(rng, 3, places=np.zeros(3))
    mapped = things(rng, 4)
    assert lay(sides(drawn, mapped), partial=partial) == []
    assert lay(sides(drawn, things(rng, 4, places=np.zeros(4))), partial=partial) == []


def test_alike_things_on_a_square_are_laid_in_all_four_ways_alike():
    corners = np.array([0.0, 1.0, 1.0 + 1j, 1j]) * 4.0
    square = things(np.random.default_rng(0), 4, places=corners)
    square = square._replace(sizes=np.zeros(4), shapes=np.zeros(4, dtype=complex))
    laid = lay(sides(square, square))
    best = {tuple(each.partners.tolist()) for each in laid if each.score > -1e-6}
    assert best == {tuple((k + np.arange(4)) % 4) for k in range(4)}


@pytest.mark.parametrize("partial", [True, False])
def test_a_map_that_was_right_a_moment_ago_is_mended(partial, monkeypatch):
    monkeypatch.setattr(module, "_NEAR_POSES", 0)  # no other way of laying leads to it
    drawn, mapped, order = copied(2, 5, 7)
    seen, before = sides(drawn, mapped), np.array([order[0], order[1], -1, order[3], -1])
    assert near_maps(seen, [], partial=partial) == []
    laid = near_maps(seen, [np.full(5, -1), before], maps=9, partial=partial)
    np.testing.assert_array_equal(laid[0].partners, order)
    u, t, _ = laid[0].pose
    np.testing.assert_allclose(u * drawn.places + t, mapped.places[order], atol=1e-6)
    assert laid[0].score == pytest.approx(0.0, abs=1e-6)
    assert 1 < len({each.partners.tobytes() for each in laid}) == len(laid) <= 9
    assert min(each.lines for each in laid) >= (3 if partial else 5)


def test_the_better_of_two_maps_that_were_right_a_moment_ago_comes_first():
    drawn, mapped, order = copied(3, 4, 8)
    wrong = np.setdiff1d(np.arange(8), order)
    laid = near_maps(sides(drawn, mapped), [wrong, order], maps=500)
    np.testing.assert_array_equal(laid[0].partners, order)
    scores = [each.score for each in laid]
    assert scores == sorted(scores, reverse=True)


def test_whoever_moves_to_another_place_is_found_there_by_a_few_pairs():
    drawn, mapped, order = copied(5, 6, 9)
    laid = near_maps(sides(drawn, mapped), [np.roll(order, 1)])
    np.testing.assert_array_equal(laid[0].partners, order)


def test_what_was_found_just_before_is_known_of_the_same_alone():
    drawn, mapped, _ = copied(6, 4, 6)
    seen, other = sides(drawn, mapped), sides(mapped, drawn, swapped=True)
    assert known_maps(seen) is known_maps(seen)
    assert known_maps(other) is not known_maps(seen)
    laid = lay(seen, poses=5, maps=8)
    assert known_maps(seen, 5, 8, True) is laid
    assert known_maps(seen, 5, 9, True) is not laid


@pytest.fixture
def poses(monkeypatch):
    """Return how many poses were weighed at each step, and how many refined."""
    weighed, refined = [], []
    guess, refine = module.guess_poses, module.refine_guesses

    def counted(*arguments):
        before = int(arguments[-1].state[1])
        guess(*arguments)
        weighed.append(int(arguments[-1].state[1]) - before)

    def noted(*arguments):
        refined.append(len(arguments[0]))
        return refine(*arguments)

    monkeypatch.setattr(module, "guess_poses", counted)
    monkeypatch.setattr(module, "refine_guesses", noted)
    return weighed, refined


def test_when_it_is_late_the_fewest_pairs_and_few_poses_do(poses, monkeypatch):
    monkeypatch.setattr(module, "_STEP", 600)
    weighed, refined = poses
    drawn, mapped, order = copied(7, 12, 12)
    seen = sides(drawn, mapped)
    laid = known_maps(seen, late=lambda: True)
    np.testing.assert_array_equal(laid[0].partners, order)
    few = sum(weighed)
    assert refined == [16]
    # It is not taken for all that there is.
    assert len(known_maps(seen)) > len(laid)
    assert sum(weighed) - few > 2 * few
    assert sum(refined) - 16 >= 60


def test_what_was_weighed_before_the_end_of_a_search_is_not_weighed_again(poses, monkeypatch):
    monkeypatch.setattr(module, "_STEP", 600)
    weighed, refined = poses
    drawn, mapped, order = copied(8, 12, 12)
    seen = sides(drawn, mapped)
    work = laid_maps(seen)
    for _ in range(12):
        next(work)
    work.close()
    begun = len(weighed)
    laid = known_maps(seen, late=lambda: True)
    np.testing.assert_array_equal(laid[0].partners, order)
    assert (len(weighed), refined) == (begun, [16])
    # Nor is it for all that there is, which is the same with it.
    whole = known_maps(seen)
    assert len(weighed) > begun
    module._RECENT.clear()
    module._BEGUN.clear()
    for a, b in zip(known_maps(seen), whole, strict=True):
        assert (a.partners.tolist(), a.pose, a.score) == (b.partners.tolist(), b.pose, b.score)


def test_far_pairs_are_laid_first_and_each_object_soon():
    places = np.array([0.0, 1.0, 10.0, 12.0 + 1e-6j])
    pairs = module._pairs(things(np.random.default_rng(0), 4, places=places))
    # 12; 10 − 1 of two that are new; then what is left, 11, 10 and 2 and 1, of used ones.
    assert pairs.tolist() == [[0, 3], [1, 2], [1, 3], [0, 2], [2, 3], [0, 1]]
    few = module._pairs(things(np.random.default_rng(0), 4, places=places), 2)
    assert few.tolist() == pairs[:2].tolist()
    many = module._pairs(things(np.random.default_rng(0), 30))
    assert len({tuple(sorted(pair)) for pair in many.tolist()}) == len(many) == 60


def test_work_between_pauses_is_bounded(poses):
    weighed, refined = poses
    drawn, mapped, order = copied(0, 60, 60)
    work = laid_maps(sides(drawn, mapped), 60, 120, True)
    most = before = 0
    while True:
        try:
            next(work)
        except StopIteration as stop:
            laid = stop.value
            break
        most, before = max(most, sum(refined) - before), sum(refined)
    np.testing.assert_array_equal(laid[0].partners, order)
    assert max(weighed) <= module._STEP + 60
    assert 0 < most <= module._PAIRINGS // 60**2 + 1
