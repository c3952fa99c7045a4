"""Turning and comparing histograms, against loops over the bins."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sketchmatch.kernels.alignment import cosine_rows, main_directions, rotated_rows
from tests.oracle import relations as oracle
from tests.strategies import floats

SIZES = st.sampled_from([4, 8, 12, 180])
SEEDS = st.integers(0, 2**32)


@given(SEEDS, SIZES, st.lists(floats(0.0, 2 * math.pi), min_size=1, max_size=5))
@settings(deadline=None, max_examples=100)
def test_rows_turn_as_the_definition_says(seed, bins, rotations):
    rng = np.random.default_rng(seed)
    histogram, factors = rng.random(bins), rng.uniform(0.01, 100.0, len(rotations))
    rows = rotated_rows(histogram, np.array(rotations), factors)
    for row, rotation, factor in zip(rows, rotations, factors, strict=True):
        expected = factor * np.array(oracle.turned(histogram, rotation))
        np.testing.assert_allclose(row, expected, rtol=1e-9, atol=1e-9 * factor)


@pytest.mark.parametrize("steps", range(12))
def test_turning_by_whole_steps_moves_bins_ahead(steps):
    histogram = np.arange(12.0)
    (row,) = rotated_rows(histogram, np.array([math.tau * steps / 12]), np.ones(1))
    np.testing.assert_allclose(row, np.roll(histogram, steps), atol=1e-12)


def test_between_bins_values_mix_and_the_last_meets_the_first():
    (row,) = rotated_rows(np.array([4.0, 0, 0, 0]), np.array([math.tau * 3.25 / 4]), np.ones(1))
    np.testing.assert_allclose(row, [1.0, 0, 0, 3.0], atol=1e-12)


@given(SEEDS, SIZES)
@settings(deadline=None, max_examples=50)
def test_the_main_direction_is_that_of_the_mean_vector(seed, bins):
    # Twice as much weight on one side keeps the direction well defined.
    rng = np.random.default_rng(seed)
    histograms = rng.random((3, bins)) + np.roll(np.arange(bins) < bins // 2, seed % bins)
    for computed, row in zip(main_directions(histograms), histograms, strict=True):
        assert computed == pytest.approx(oracle.main_direction(row), abs=1e-9)


def test_main_directions_by_hand():
    rows = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [1, 1, 0, 0], [0, 0, 0, 1], [0, 0, 0, 0]])
    expected = [0.0, math.pi / 2, math.pi / 4, -math.pi / 2, 0.0]
    assert main_directions(rows) == pytest.approx(expected)


@given(SEEDS, SIZES, st.sampled_from([1.0, 1e-8, 1e8]))
@settings(deadline=None, max_examples=50)
def test_the_cosine_is_that_of_the_definition(seed, bins, scale):
    rng = np.random.default_rng(seed)
    first, second = scale * rng.random((2, 3, bins))
    expected = [oracle.cross_correlation(x, y) for x, y in zip(first, second, strict=True)]
    assert cosine_rows(first, second) == pytest.approx(expected, rel=1e-9)
