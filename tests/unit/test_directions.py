"""Effective forces of half a turn, beside their definition."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sketchmatch.kernels.directions import effective_forces
from sketchmatch.pipeline.words import _half_turns


def by_definition(row, turns, d, sign):
    """Return the effective forces of a direction, and their moment, force by force."""
    parts = [
        (row[(sign * place) % len(row)] * width, low, width, ahead)
        for place, low, width, ahead in zip(*(each[d] for each in turns), strict=True)
    ]
    against = math.fsum(force for force, _, _, ahead in parts if not ahead)
    left = max(0.0, math.fsum(force for force, _, _, ahead in parts if ahead) - against)
    effective, moment = left, 0.0
    for force, low, width, ahead in parts:
        if ahead and force > 0.0:
            kept = min(force, left)
            moment += kept * (low + 0.5 * width * kept / force)
            left -= kept
    return effective, moment


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.sampled_from([4, 6, 16, 36]), st.floats(-50.0, 50.0))
def test_forces_and_moments_are_those_of_the_definition(seed, bins, start):
    rng = np.random.default_rng(seed)
    rows = np.maximum(rng.normal(0.3, 1.0, (3, bins)), 0.0)
    starts = (start, start + bins / 8.0)
    for sign, turns in (
        (1, _half_turns(bins, starts)),
        (-1, _half_turns(bins, tuple(-each for each in starts))),
    ):
        forces, moments = effective_forces(rows, turns, sign)
        expected = np.array(
            [[by_definition(row, turns, d, sign) for d in range(2)] for row in rows]
        )
        assert forces == pytest.approx(expected[..., 0], abs=1e-9)
        assert moments == pytest.approx(expected[..., 1], abs=1e-9)


def test_what_lies_against_a_direction_takes_away_what_is_farthest_off():
    bins = 8
    turns = _half_turns(bins, (0.0,))
    row = np.zeros((1, bins))
    row[0, [0, 1]] = 1.0
    forces, moments = effective_forces(row, turns, 1)
    assert forces[0, 0] == pytest.approx(1.5)  # of the bin in the direction itself a half
    row[0, 4] = 2.0  # half of it, behind
    fewer, nearer = effective_forces(row, turns, 1)
    assert fewer[0, 0] == pytest.approx(0.5)
    assert nearer[0, 0] / fewer[0, 0] < moments[0, 0] / forces[0, 0]
