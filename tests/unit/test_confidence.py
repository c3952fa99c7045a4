"""ζ of a histogram map against double loops."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.kernels.confidence import mean_absolute_difference
from sketchmatch.model import Fmap, RelationTable
from sketchmatch.pipeline.correspond import fmap_confidence
from tests.interpreted import examples
from tests.oracle import maps as oracle
from tests.strategies import floats, tables

WEIGHTS = st.tuples(floats(0.1, 5.0), floats(0.0, 5.0), floats(0.0, 5.0))


@given(st.data(), tables(), WEIGHTS)
@examples(150)
def test_it_agrees_with_double_loops_on_any_fmap(data, table, weights):
    count = 2 * table.argument_pairs
    size = table.template_pairs
    entries = data.draw(st.lists(st.integers(0, count - 1), min_size=size, max_size=size))
    found = fmap_confidence(Fmap(np.array(entries)), table, weights)
    expected = oracle.confidence(table, oracle.read(entries, table.argument_objects), weights)
    assert (found.total, found.similarity, found.rotation, found.dilation) == pytest.approx(
        expected, rel=1e-9, abs=1e-12
    )
    assert all(0.0 <= part <= 1.0 + 1e-12 for part in expected)


@given(st.lists(floats(-1e6, 1e6), min_size=1, max_size=150))
@examples(150)
def test_the_mean_difference_is_that_of_all_pairs(values):
    gaps = [abs(x - y) for k, x in enumerate(values) for y in values[:k]]
    expected = math.fsum(gaps) / len(gaps) if gaps else 0.0
    found = mean_absolute_difference(np.array(values))
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * max(map(abs, values)))


@pytest.mark.parametrize("size", [1, 2, 63, 64, 65, 66, 500])
def test_the_mean_difference_of_evenly_spread_values(size):
    values = np.random.default_rng(size).permutation(size).astype(float)
    assert mean_absolute_difference(values) == pytest.approx((size + 1) / 3 if size > 1 else 0.0)


def test_equal_turns_and_dilations_give_full_marks_however_large():
    table = RelationTable(np.full((3, 3), 0.4), np.full((3, 3), 5.0), np.full((3, 3), 7.0), 3, 3)
    found = fmap_confidence(Fmap(np.array([0, 1, 2])), table)
    parts = (found.similarity, found.rotation, found.dilation)
    assert parts == pytest.approx((0.4, 1.0, 1.0))
    assert found.total == pytest.approx(0.8)


def test_a_dual_turns_by_half():
    table = RelationTable(np.ones((3, 3)), np.zeros((3, 3)), np.ones((3, 3)), 3, 3)
    assert fmap_confidence(Fmap(np.array([0, 1, 2])), table).rotation == pytest.approx(1.0)
    assert fmap_confidence(Fmap(np.array([3, 4, 5])), table).rotation == pytest.approx(1.0)
    assert fmap_confidence(Fmap(np.array([0, 1, 5])), table).rotation == pytest.approx(1 / 3)


def test_one_doubling_among_two_entries_costs_half_to_the_three_halves():
    # L̂ = 1.5 for a doubling, so ζL = exp(−ln 2 · 1.5); three entries 0, 0, 1.5 have mean gap 1.
    table = RelationTable(
        np.ones((3, 3)), np.zeros((3, 3)), [[1, 1, 1], [1, 1, 1], [2, 2, 2]], 3, 3
    )
    assert fmap_confidence(Fmap(np.array([0, 1, 2])), table).dilation == pytest.approx(0.5)


def test_weights_choose_among_the_parts():
    table = RelationTable([[0.25]], [[1.0]], [[3.0]], 2, 2)
    fmap = Fmap(np.array([0]))
    assert fmap_confidence(fmap, table, (1.0, 0.0, 0.0)).total == pytest.approx(0.25)
    assert fmap_confidence(fmap, table, (0.0, 0.0, 2.0)).total == pytest.approx(1.0)
    assert fmap_confidence(fmap, table, (3.0, 1.0, 0.0)).total == pytest.approx(1.75 / 4)
