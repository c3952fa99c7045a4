"""Sorting in kernels, beside NumPy's."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sketchmatch.api.kernels import sort_values


def assert_sorts(values):
    given, own = np.array(values, dtype=float), np.array(values, dtype=float)
    sort_values(own)
    assert own.tolist() == np.sort(given).tolist()


@given(st.lists(st.floats(allow_nan=False) | st.sampled_from([0.0, 1.0, 2.0]), max_size=400))
@example([])
@example([1.0] * 300)
def test_values_are_sorted(values):
    assert_sorts(values)


@pytest.mark.parametrize("count", [64, 65, 66, 129, 1000, 4950])
@pytest.mark.parametrize(
    "of",
    [
        np.arange,
        lambda count: -np.arange(count),
        lambda count: np.arange(count) % 3,
        lambda count: np.abs(np.arange(count) - count / 2),
        lambda count: np.random.default_rng(count).normal(size=count),
    ],
    ids=["rising", "falling", "few", "a valley", "random"],
)
def test_so_are_many_of_every_kind(count, of):
    assert_sorts(of(count))
