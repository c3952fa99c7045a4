"""The steps of ``direct``'s evolution on their own: each against a slow and obvious one."""

from collections import Counter
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.api.kernels import empty_map_state, place_map
from sketchmatch.model import DILATION_SCALE, RelationTable, object_pairs
from sketchmatch_builtin.searchers import _memetic as steps
from sketchmatch_builtin.searchers import _moves
from sketchmatch_builtin.searchers._moves import (
    empty_moves,
    read_relations,
    renew_moves,
    weigh_moves,
)
from tests.oracle import maps as oracle
from tests.oracle.enumeration import every_confidence
from tests.searching import geometric_table
from tests.strategies import random_table

SEEDS = st.integers(0, 2**32)


def read(table, weights=(1.0, 1.0, 1.0)):
    """Return the state, the moves and the leanings that a search begins with."""
    objects, others = table.template_objects, table.argument_objects
    state = empty_map_state(table, weights)
    moves = empty_moves(objects, others, table.evidence is not None)
    leanings = np.zeros((objects, others, 3))
    pairs = (object_pairs(objects), object_pairs(others))
    read_relations(state, moves, *pairs, 0, table.similarity.size, leanings)
    return state, moves, leanings


def founded(table, weights, rotation, level, seed):
    """Return a new map for a rotation and a level, of which chance decides the order alone."""
    state, moves, leanings = read(table, weights)
    child = np.full(table.template_objects, -1)
    rng = np.random.default_rng(seed)
    steps._found(state, moves, leanings, rotation, level, 0.0, child, rng)
    return child.tolist()


def test_every_order_is_as_likely():
    rng = np.random.default_rng(0)
    found = Counter(tuple(steps._shuffled(3, rng).tolist()) for _ in range(3000))
    assert set(found) == set(permutations(range(3)))
    assert all(420 < count < 580 for count in found.values())


def test_the_best_of_a_tournament_is_chosen():
    rng = np.random.default_rng(0)
    found = Counter(steps._select(4, 2, rng) for _ in range(4000))
    # The best of two out of four is the k-th of them with these chances, in sixteenths.
    for k, sixteenths in enumerate((7, 5, 3, 1)):
        assert found[k] / 250 == pytest.approx(sixteenths, abs=0.6)


@pytest.mark.parametrize("weights", [(0.0, 1.0, 0.0), (0.0, 2.0, 1.0), (1.0, 1.0, 1.0)])
@pytest.mark.parametrize("turn", [0.0, 1.0, 2.5, 4.0])
def test_a_new_map_puts_a_turned_copy_upon_itself(turn, weights):
    right = 0
    for seed in range(10):
        rng = np.random.default_rng(seed)
        points = rng.uniform(0.0, 1.0, (7, 2))
        cosine, sine = 2.0 * np.cos(turn), 2.0 * np.sin(turn)
        copy = points @ np.array([[cosine, sine], [-sine, cosine]])
        table = geometric_table(points, copy, 0.0, rng)
        found = founded(table, weights, turn, DILATION_SCALE * np.log(2.0), seed)
        assert sorted(found) == list(range(7))
        right += sum(a == c for a, c in enumerate(found))
    assert right > 45  # of 70; by chance 10 would be


def test_of_partners_that_suit_alike_the_first_is_taken():
    same = np.full((3, 10), 0.5)
    table = RelationTable(same, same, same, 3, 5)
    for seed in range(5):
        assert sorted(founded(table, (1.0, 0.0, 0.0), 0.0, 0.0, seed)) == [0, 1, 2]


@st.composite
def parents(draw):
    """Return two object maps and the number of argument objects."""
    objects = draw(st.integers(2, 7))
    others = objects + draw(st.integers(0, 3))
    one, other = (np.array(draw(st.permutations(range(others)))[:objects]) for _ in range(2))
    return one, other, others


@given(parents(), SEEDS, st.sampled_from([0.0, 0.5, 1.0]))
def test_a_child_has_its_parents_partners_where_it_can(case, seed, rate):
    one, other, others = case
    child = np.empty(len(one), dtype=np.int64)
    steps._cross(one, other, rate, child, others, np.random.default_rng(seed))
    assert len(set(child.tolist())) == len(one)
    assert set(child.tolist()) <= set(range(others))
    assert (child == one)[one == other].all()
    if rate != 0.5:
        assert child.tolist() == (one if rate == 0.0 else other).tolist()
    for a, c in enumerate(child.tolist()):
        if c not in (one[a], other[a]):  # both were taken
            assert {int(one[a]), int(other[a])} <= set(child.tolist())


@given(SEEDS, st.integers(2, 6))
def test_rotation_and_level_of_a_map_are_those_of_its_entries(seed, objects):
    rng = np.random.default_rng(seed)
    table = random_table(rng, objects, objects + 1)
    partners = rng.permutation(objects + 1)[:objects]
    entries = [
        oracle.look_up(table, i, pair)
        for i, pair in enumerate(oracle.induced(tuple(partners.tolist())))
    ]
    rotation, level = steps._rotation_and_level(read(table)[0], partners)
    whole = sum(np.exp(1j * turn) for _, turn, _ in entries)
    assert np.exp(1j * rotation) == pytest.approx(whole / abs(whole), abs=1e-9)
    levels = [DILATION_SCALE * np.log(dilation) for _, _, dilation in entries]
    assert level == pytest.approx(np.mean(levels), abs=1e-9)


@pytest.mark.parametrize("weights", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (2.0, 1.0, 0.0)])
def test_where_dilation_counts_for_nothing_only_moves_above_a_threshold_are_evaluated(weights):
    evaluated = above = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        table = random_table(rng, 5, 6)
        state, moves, _ = read(table, weights)
        threshold = place_map(state, rng.permutation(6)[:5])
        renew_moves(state, moves)
        for a in range(5):
            evaluated += weigh_moves(state, moves, a, threshold)
            above += (moves.values >= 0.0).sum()
    assert evaluated == above > 100


def entries_of(table, partners):
    """Return e, e^{iR} and L̂ of each entry of a map."""
    found = [oracle.look_up(table, i, pair) for i, pair in enumerate(oracle.induced(partners))]
    similar, turns, dilations = np.array(found).T
    return similar, np.exp(1j * turns), DILATION_SCALE * np.log(dilations)


def moved(partners, a, c):
    """Return a map after a move: a gets c, and who had it what a had."""
    after = partners.copy()
    after[after == c] = partners[a]
    after[a] = c
    return tuple(after.tolist())


@given(SEEDS, st.integers(2, 6))
def test_lines_lie_below_the_sum_of_distances_and_close_to_it(seed, objects):
    rng = np.random.default_rng(seed)
    table = random_table(rng, objects, objects + 1)
    state, moves, _ = read(table)
    place_map(state, rng.permutation(objects + 1)[:objects])
    renew_moves(state, moves)
    levels = np.sort(state.levels)
    low, high, count = levels[0], levels[-1], len(levels)
    for value in [*levels, *rng.uniform(low - 1.0, high + 1.0, 9)]:
        line, distance = _moves._line(moves.lines, value), abs(levels - value).sum()
        assert line <= distance + 1e-9
        # Off by 2 for each level, and by its distance, between the value and the middle of a
        # bucket: no more than those of the bucket.
        bucket = min(max(np.floor((value - low) * count / (high - low or 1.0)), 0), count - 1)
        width = (high - low) / count
        within = (levels >= low + bucket * width - 1e-9) & (
            levels <= low + (bucket + 1) * width + 1e-9
        )
        outside = max(low - value, value - high, 0.0)
        assert distance - line <= 2.0 * within.sum() * (width + outside) + 1e-9


@pytest.mark.parametrize("weights", [(1.0, 1.0, 1.0), (0.0, 0.0, 1.0), (1.0, 0.0, 5.0)])
def test_the_most_promising_move_is_the_best_by_the_tangent_of_dilation(weights):
    w_s, w_r, w_l = np.array(weights) / sum(weights)
    none = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        table = random_table(rng, 4, 5)
        state, moves, _ = read(table, weights)
        partners = rng.permutation(5)[:4]
        now = place_map(state, partners)
        renew_moves(state, moves)
        before = entries_of(table, tuple(partners.tolist()))[2]
        count = len(before)
        scale = 2.0 / (count * (count - 1))
        level = 2.0 ** (-scale * sum(abs(before[i] - before[:i]).sum() for i in range(count)))
        worths = {}
        for a in range(4):
            for c in set(range(5)) - {int(partners[a])}:
                similar, turns, levels = entries_of(table, moved(partners, a, c))
                more = sum(
                    _moves._line(moves.lines, new) - _moves._line(moves.lines, old)
                    for new, old in zip(levels, before, strict=True)
                    if new != old
                )
                worths[a, c] = (
                    w_s * similar.mean()
                    + w_r * abs(turns.mean())
                    + w_l * level * (1.0 - np.log(2.0) * scale * more)
                )
        a, c = _moves._most_promising(state, moves)
        if a < 0:
            none += 1
            assert max(worths.values()) <= now + 1e-5
        else:
            # What is read of relations has seven digits.
            assert worths[a, c] == pytest.approx(max(worths.values()), abs=1e-5)
            assert worths[a, c] > now
    assert none < 12


@pytest.mark.parametrize("weights", [(1.0, 1.0, 1.0), (0.0, 0.0, 1.0), (1.0, 0.0, 5.0)])
def test_no_move_above_a_threshold_is_missed_and_some_below_are_left_out(weights):
    evaluated = above = possible = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        table = random_table(rng, 4, 5)
        state, moves, _ = read(table, weights)
        partners = rng.permutation(5)[:4]
        place_map(state, partners)
        renew_moves(state, moves)
        every = every_confidence(table, weights)
        threshold = float(np.quantile(list(every.values()), 0.9))
        for a in range(4):
            evaluated += weigh_moves(state, moves, a, threshold)
            for c in range(5):
                b = int(state.holders[c])
                if 0 <= b <= a:  # an exchange is weighed once
                    assert moves.values[c] == -1.0
                    continue
                value = every[moved(partners, a, c)]
                expected = value if value > threshold else -1.0
                assert moves.values[c] == pytest.approx(expected, abs=1e-9)
                above += value > threshold
                possible += 1
    assert 0 < above <= evaluated < possible
