"""Turning histograms, against loops over the bins."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.kernels.alignment import (
    interpolated_products,
    main_directions,
    main_turns,
    peak_turns,
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


@given(SEEDS, st.sampled_from([3, 4, 12]))
@examples(50)
def test_main_turns_lead_from_the_template_s_direction_to_the_argument_s(seed, bins):
    rng = np.random.default_rng(seed)
    first, second = rng.uniform(-math.tau, math.tau, 4), rng.uniform(-math.tau, math.tau, 3)
    second[0] = first[0]
    whole, rest = main_turns(*split_turns(first, bins), *split_turns(second, bins), bins)
    assert whole.shape == rest.shape == (4, 3)
    assert ((whole >= 0) & (whole < bins)).all()
    assert ((rest >= 0.0) & (rest <= 1.0)).all()
    assert (whole[0, 0], rest[0, 0]) == (0, 0.0)
    turn = (whole + rest) * math.tau / bins
    np.testing.assert_allclose(np.exp(1j * (first[:, None] + turn - second)), 1.0, atol=1e-12)


@given(SEEDS, st.sampled_from([3, 4, 12]), st.integers(1, 3))
@examples(50)
def test_products_between_bins_are_those_of_the_turned_histogram(seed, bins, width):
    rng = np.random.default_rng(seed)
    first, second = rng.random((2, bins)), rng.random((5, bins))
    rests, others = rng.random(2), rng.random(5)
    blocks = np.zeros((math.ceil(5 / width), width, bins))
    blocks.reshape(-1, bins)[:5] = second
    about = np.concatenate([np.roll(first, k, axis=1) for k in (-1, 0, 1)])
    found = interpolated_products(about @ blocks.swapaxes(1, 2), rests, others)
    turns = (others - rests[:, None]) * math.tau / bins
    for i, j in np.ndindex(2, 5):
        expected = oracle.turned(first[i], turns[i, j]) @ second[j]
        assert found[i, j] == pytest.approx(expected, abs=1e-12)


def peaks(first, second):
    """Return what `peak_turns` finds for one histogram and another."""
    bins = len(first)
    products = np.array([[[np.roll(first, w) @ second for w in range(bins)]]])
    found = peak_turns(products, np.array([first @ first]), roughness(first[None]))
    return tuple(each[0, 0] for each in found)


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
@given(seed=SEEDS, bins=st.sampled_from([3, 4, 7]))
@examples(30)
def test_no_turn_is_better_than_the_peak(scale, seed, bins):
    rng = np.random.default_rng(seed)
    first, second = scale * rng.random((2, bins)) ** 3
    whole, rest, product = peaks(first, second)
    row = turned_rows(first, np.array([whole]), np.array([rest]))[0]
    assert product == pytest.approx(row @ second, rel=1e-12)
    places = np.linspace(0.0, 1.0, 40)
    best = max(
        oracle.cross_correlation(each, second)
        for w in range(bins)
        for each in turned_rows(first, np.full(40, w), places)
    )
    found = oracle.cross_correlation(row, second)
    assert best - 1e-12 <= found
    assert found <= best + 0.01
    assert 0 <= whole < bins
    assert 0.0 <= rest < 1.0


@pytest.mark.parametrize("steps", range(4))
def test_of_equal_peaks_the_smallest_turn_counts(steps):
    first = np.array([3.0, 1.0, 0.0, 0.0] * 2)
    whole, rest, product = peaks(first, np.roll(first, steps))
    assert (whole, rest, product) == (steps, 0.0, 20.0)


@pytest.mark.parametrize(("more", "expected"), [(0.0, 1), (9e-13, 1), (3e-12, 3), (1e-6, 3)])
def test_peaks_are_equal_to_twelve_digits(more, expected):
    # The square of the cosine is compared, and grows twice as fast.
    products = np.array([[[0.0, 1.0, 0.0, 1.0 + more]]])
    whole, rest, product = peak_turns(products, np.array([1.0]), np.array([1.0]))
    assert (whole[0, 0], rest[0, 0], product[0, 0]) == (expected, 0.0, products[0, 0, expected])


def test_a_turn_to_nothing_in_common_is_none():
    whole, rest, product = peak_turns(-np.ones((1, 1, 4)), np.array([1.0]), np.array([0.5]))
    assert (whole[0, 0], rest[0, 0], product[0, 0]) == (0, 0.0, 0.0)
