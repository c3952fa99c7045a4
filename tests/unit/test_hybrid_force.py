"""The kernel of hybrid forces: unit squares, by hand and by definition."""

import math

import numpy as np
import pytest

from sketchmatch.kernels.hybrid_force import hybrid_force_histograms
from sketchmatch.kernels.power_force import APART, OVERLAPPING, TOUCHING
from tests.oracle.laws import REAL, WHOLE, law_histogram

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def psi(distance, radius):
    """Return Ψ⁺, whose second derivative is the force."""
    x = max(distance, 0.0) / radius
    return x * x / 2 if x <= 1 else 0.5 + 2 * (x - 1) - math.log(x)


def pull(gap, radius):
    """Return the force of a square on one as far to its left."""
    return psi(2 + gap, radius) - 2 * psi(1 + gap, radius) + psi(gap, radius)


@pytest.mark.parametrize("radius", [0.01, 0.25, 0.75, 1.0, 1.2, 2.5, 10.0])
@pytest.mark.parametrize(
    ("gap", "relation"),
    [(1.0, APART), (0.125, APART), (0.0, TOUCHING), (-0.5, OVERLAPPING), (-1.0, OVERLAPPING)],
)
def test_squares_beside_each_other(gap, relation, radius):
    starts = np.concatenate([SQUARE + np.array([1.0 + gap, 0.0]), SQUARE])
    ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in (starts[:4], starts[4:])])
    found = hybrid_force_histograms(
        starts,
        ends,
        np.array([0, 4, 8]),
        np.array([[0, 1], [1, 0]]),
        4,
        np.full(2, radius),
        np.full(2, relation),
    )
    forward, backward = pull(gap, radius), pull(-2.0 - gap, radius)
    assert found[0, [0, 2]] == pytest.approx([forward, backward], rel=1e-9, abs=1e-12)
    assert found[1, [0, 2]] == pytest.approx([backward, forward], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("radius", [0.3, 1.0, 4.0])
@pytest.mark.parametrize(("place", "relation"), [((0.5, 0.25), OVERLAPPING), ((1.75, 0.5), APART)])
def test_any_direction_is_as_the_definition_says(place, relation, radius):
    first, second = SQUARE @ np.array([[0.8, 0.6], [-0.6, 0.8]]) + np.array(place), SQUARE
    starts = np.concatenate([first, second])
    ends = np.concatenate([np.roll(first, -1, axis=0), np.roll(second, -1, axis=0)])
    (found,) = hybrid_force_histograms(
        starts,
        ends,
        np.array([0, 4, 8]),
        np.array([[0, 1]]),
        12,
        np.array([radius]),
        np.array([relation]),
    )
    reach = REAL(radius)
    law = [(REAL(0), reach, REAL(0), 1 / reach**2), (reach, WHOLE, REAL(2), REAL(1))]
    expected = law_histogram([first], [second], law, 12)
    assert np.abs(found - expected).max() <= 1e-9 * expected.max()
