"""ζ of object maps that is brought up to date move by move, against the slow oracle."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sketchmatch.api.kernels import (
    confidence_after,
    empty_map_state,
    make_move,
    map_confidence,
    map_entry,
    map_evidence,
    place_map,
    total_distance,
)
from tests.interpreted import examples
from tests.oracle import maps as oracle
from tests.strategies import random_table, tables_and_object_maps

EXACT = 1e-11
EQUAL = (1.0, 1.0, 1.0)
DILATIONS = {
    "any": lambda rng, shape: np.exp(rng.uniform(-1.5, 1.5, shape)),
    "equal": lambda _, shape: np.full(shape, 3.0),
    "tied": lambda rng, shape: rng.choice([0.5, 1.0, 2.0], shape),
    "equal but for rounding": lambda rng, shape: 3.0 + rng.integers(0, 3, shape) * 4.5e-16,
    "wide": lambda rng, shape: np.exp(rng.uniform(-300.0, 300.0, shape)),
    "close with outliers": lambda rng, shape: np.where(
        rng.random(shape) < 0.2,
        np.exp(rng.uniform(-600.0, 600.0, shape)),
        1.0 + rng.integers(0, 2, shape) * 2.3e-16,
    ),
}

weightings = st.tuples(*3 * [st.floats(0.0, 10.0)]).filter(lambda w: sum(w) > 1e-3)
kinds = st.sampled_from(sorted(DILATIONS))


def of_kind(table, kind, seed=0):
    """Return a table with other dilations."""
    dilation = DILATIONS[kind](np.random.default_rng(seed), table.dilation.shape)
    return replace(table, dilation=dilation)


def placed(table, partners, weights=EQUAL):
    state = empty_map_state(table, weights)
    place_map(state, np.array(partners, dtype=np.int64))
    return state


def true_confidence(table, partners, weights=EQUAL):
    partners = [int(partner) for partner in partners]
    return pytest.approx(
        oracle.confidence(table, oracle.induced(partners), weights)[0], rel=0, abs=EXACT
    )


def moved(partners, a, c):
    """Return a map after a move, as a list."""
    after = [int(partner) for partner in partners]
    if c in after:
        after[after.index(c)] = after[a]
    after[a] = c
    return after


def every_move(partners, others):
    return [(a, c) for a in range(len(partners)) for c in range(others) if c != partners[a]]


def assert_same_state(state, table):
    """Check all that a state says about itself, by loops."""
    partners = state.partners.tolist()
    holders = [partners.index(c) if c in partners else -1 for c in range(table.argument_objects)]
    assert state.holders.tolist() == holders
    levels = []
    for a, b in oracle.pairs(len(partners)):
        expected = map_entry(state, a, b, partners[a], partners[b])
        expected += (map_evidence(state, a, b, partners[b], partners[a]),)
        assert tuple(state.entries[a, b]) == tuple(state.entries[b, a]) == expected
        assert expected[0] == map_evidence(state, a, b, partners[a], partners[b])
        levels.append(expected[3])
    assert state.levels.tolist() == sorted(levels)
    assert state.prefix == pytest.approx(np.cumsum([0.0, *sorted(levels)]), abs=1e-9)


@given(tables_and_object_maps(), kinds, weightings)
@examples(150)
def test_a_placed_map_has_its_confidence(case, kind, weights):
    table, partners = case
    table = of_kind(table, kind)
    state = empty_map_state(table, weights)
    assert place_map(state, partners[::-1].copy()) == true_confidence(
        table, partners[::-1], weights
    )
    # Whatever was there before makes no difference.
    value = place_map(state, partners)
    assert value == true_confidence(table, partners, weights)
    assert value == map_confidence(state) == map_confidence(placed(table, partners, weights))
    assert_same_state(state, table)


@given(tables_and_object_maps(most=6), kinds, weightings)
@examples(120)
def test_confidence_after_any_move_is_foreseen(case, kind, weights):
    table, partners = case
    table = of_kind(table, kind)
    state = placed(table, partners, weights)
    before = map_confidence(state)
    for a, c in every_move(partners, table.argument_objects):
        expected = true_confidence(table, moved(partners, a, c), weights)
        assert confidence_after(state, a, c) == expected
    assert state.partners.tolist() == partners.tolist(), "the map stays"
    assert map_confidence(state) == before
    assert_same_state(state, table)


@given(tables_and_object_maps(), kinds, weightings, st.integers(0, 2**32))
@examples(100)
def test_moves_in_a_row_lead_where_they_say(case, kind, weights, seed):
    table, partners = case
    table = of_kind(table, kind)
    state, rng = placed(table, partners, weights), np.random.default_rng(seed)
    expected = partners.tolist()
    for _ in range(8):
        moves = every_move(expected, table.argument_objects)
        a, c = moves[rng.integers(len(moves))]
        foreseen = confidence_after(state, a, c)
        expected = moved(expected, a, c)
        value = make_move(state, a, c)
        assert state.partners.tolist() == expected
        assert value == map_confidence(state) == true_confidence(table, expected, weights)
        assert foreseen == pytest.approx(value, rel=0, abs=EXACT)
        assert_same_state(state, table)


@pytest.mark.parametrize("kind", DILATIONS)
def test_no_rounding_builds_up_over_many_moves(kind):
    rng = np.random.default_rng(1)
    table = of_kind(random_table(rng, 12, 15), kind)
    state = placed(table, rng.permutation(15)[:12])
    for _ in range(3000):
        moves = every_move(state.partners.tolist(), 15)
        value = make_move(state, *moves[rng.integers(len(moves))])
    assert value == map_confidence(placed(table, state.partners))
    assert value == true_confidence(table, state.partners)
    for a, c in every_move(state.partners.tolist(), 15):
        assert confidence_after(state, a, c) == true_confidence(table, moved(state.partners, a, c))


@pytest.mark.parametrize("others", [2, 3, 20])
def test_two_objects_have_one_entry(others):
    table = random_table(np.random.default_rng(2), 2, others)
    state = placed(table, [1, 0])
    for a, c in every_move([1, 0], others):
        after = moved([1, 0], a, c)
        sigma = oracle.look_up(table, 0, tuple(after))[0]
        # With one entry ζR and ζL are 1.
        assert confidence_after(state, a, c) == pytest.approx((sigma + 2.0) / 3.0, abs=EXACT)
        assert make_move(placed(table, [1, 0]), a, c) == pytest.approx(
            (sigma + 2.0) / 3.0, abs=EXACT
        )


def test_equal_dilations_agree_wholly():
    table = of_kind(random_table(np.random.default_rng(3), 6, 8), "equal")
    state = placed(table, range(6), (0.0, 0.0, 1.0))
    assert map_confidence(state) == pytest.approx(1.0, abs=EXACT)
    for a, c in every_move(range(6), 8):
        assert confidence_after(state, a, c) == pytest.approx(1.0, abs=EXACT)


@given(tables_and_object_maps(most=5), st.data())
@examples(60)
def test_an_entry_is_found_in_any_order_of_the_objects(case, data):
    table, partners = case
    state = placed(table, partners)
    a, b = data.draw(st.permutations(range(table.template_objects)))[:2]
    c, d = data.draw(st.permutations(range(table.argument_objects)))[:2]
    pair = (c, d) if a < b else (d, c)
    row = oracle.pairs(table.template_objects).index((min(a, b), max(a, b)))
    _, rotation, dilation = oracle.look_up(table, row, pair)
    level = 1.5 / np.log(2) * np.log(dilation)
    counts = table.rotation_weights[row]
    turn = (counts * np.cos(rotation), counts * np.sin(rotation))
    expected = (oracle.evidence(table, row, pair), *turn, level)
    assert map_entry(state, a, b, c, d) == pytest.approx(expected, abs=1e-14)


@given(st.integers(2, 20), kinds, st.integers(0, 2**32))
@example(20, "equal but for rounding", 0)
@example(20, "close with outliers", 0)
@examples(60)
def test_total_distance_to_values_within_and_beyond(objects, kind, seed):
    rng = np.random.default_rng(seed)
    table = of_kind(random_table(rng, objects, objects), kind, seed)
    state = placed(table, rng.permutation(objects))
    levels = state.levels
    low, high = levels[0], levels[-1]
    values = [
        *levels,
        *rng.uniform(low, high, 20),
        *(np.nextafter(levels, np.inf)),
        *(np.nextafter(levels, -np.inf)),
        low - 1500.0,
        high + 1500.0,
    ]
    for value in values:
        expected = sum(abs(float(level) - float(value)) for level in levels)
        found = total_distance(levels, state.prefix, state.buckets, value)
        assert found == pytest.approx(expected, rel=1e-12, abs=1e-9)
