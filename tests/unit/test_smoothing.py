"""Lines pulled smooth on a grid, beside their definition."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sketchmatch.kernels.smoothing import pull_smooth
from tests.oracle.smoothing import pulled


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(0, 4), st.integers(1, 6))
def test_a_line_is_pulled_smooth_as_it_is_defined(seed, rounds, parts):
    rng = np.random.default_rng(seed)
    room = rng.uniform(0.0, 1.0, (8, 9)).astype(np.float32)
    line = rng.uniform(-0.5, 9.5, (int(rng.integers(1, 12)), 2))
    least = rng.uniform(0.0, 0.6)
    found = line.copy()
    pull_smooth(found, room, least, rounds, parts)
    assert found == pytest.approx(pulled(line, room, least, rounds, parts), abs=1e-9)
    assert (found[[0, -1]] == line[[0, -1]]).all()


def test_a_corner_is_cut_where_there_is_room_and_stays_where_there_is_none():
    corner = np.array([[0.5, 0.5], [0.5, 2.5], [2.5, 2.5]])
    for room, middle in ((1.0, [1.0, 2.0]), (0.2, [0.5, 2.5])):
        line = corner.copy()
        pull_smooth(line, np.full((3, 3), room, np.float32), 0.5, 1, 4)
        assert line[1].tolist() == middle
