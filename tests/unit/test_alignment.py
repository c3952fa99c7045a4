"""Turning histograms, against loops over the bins."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.kernels.alignment import (
    main_directions,
    rolled_rows,
    roughness,
    split_turns,
    turned_rows,
)
from tests.interpreted import examples
from tests.oracle import relations as oracle
from tests.strategies import floats

SIZES = st.sampled_from([4, 8, 12, 180])
SEEDS = st.integers(0, 2**32)


def turned(histogram, rotation):
    whole, rest = split_turns(np.array([rotation]), len(histogram))
    return turned_rows(histogram, whole, rest)[0]


@given(SEEDS, SIZES, st.lists(floats(0.0, 2 * math.pi), min_size=1, max_size=5))
@examples(100)
def test_rows_turn_as_the_definition_says(seed, bins, rotations):
    histogram = np.random.default_rng(seed).random(bins)
    rows = turned_rows(histogram, *split_turns(np.array(rotations), bins))
    for row, rotation in zip(rows, rotations, strict=True):
        np.testing.assert_allclose(row, oracle.turned(histogram, rotation), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("steps", range(12))
def test_turning_by_whole_steps_moves_bins_ahead(steps):
    histogram = np.arange(12.0)
    expected = np.roll(histogram, steps)
    np.testing.assert_allclose(turned(histogram, math.tau * steps / 12), expected, atol=1e-12)
    (rolled,) = rolled_rows(histogram[None], np.array([steps - 24]))
    assert rolled.tolist() == expected.tolist()


def test_between_bins_values_mix_and_the_last_meets_the_first():
    row = turned(np.array([4.0, 0, 0, 0]), math.tau * 3.25 / 4)
    np.testing.assert_allclose(row, [1.0, 0, 0, 3.0], atol=1e-12)


@pytest.mark.parametrize("angle", [-1e-17, -5e-324, 0.0, math.tau, math.nextafter(math.tau, 0)])
def test_angles_about_a_full_turn_split_within_bounds(angle):
    whole, rest = split_turns(np.array([angle]), 180)
    assert 0 <= whole[0] < 180
    assert 0.0 <= rest[0] < 1.0
    assert math.remainder((whole[0] + rest[0]) * math.tau / 180 - angle, math.tau) == pytest.approx(
        0.0, abs=1e-12
    )


@given(SEEDS, SIZES, floats(0.0, 1.0))
@examples(50)
def test_the_sum_of_squares_between_bins_follows_from_the_roughness(seed, bins, rest):
    histogram = np.random.default_rng(seed).random(bins)
    (row,) = turned_rows(histogram, np.zeros(1, np.int64), np.array([rest]))
    (rough,) = roughness(histogram[None])
    expected = histogram @ histogram - 2 * rest * (1 - rest) * rough
    assert row @ row == pytest.approx(expected, rel=1e-12)


@given(SEEDS, SIZES)
@examples(50)
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
