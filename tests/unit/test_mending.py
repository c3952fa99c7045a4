"""Zones are mended where hands let an outline cross itself, and only there."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch import Feature
from sketchmatch.errors import InvalidInputError
from sketchmatch.transfers.mending import mended
from tests.pace import within

SQUARE = [(0, 0), (10, 0), (10, 10), (0, 10)]


def area(points):
    outline, _ = mended(np.array(points, dtype=float))
    polygon = shapely.Polygon(outline)
    assert polygon.is_valid
    return polygon.area


def place(ring, number):
    """Return where a number is on an outline."""
    k = int(number)
    a, b = ring[k], ring[(k + 1) % len(ring)]
    return a + (number - k) * (b - a)


@pytest.mark.parametrize(
    ("points", "kept"),
    [
        ([(80, 80), (90, 80), (90, 90), (80, 90), (80.5, 79.5)], [0, 1, 2, 3]),
        ([*SQUARE, (-0.2, -1), (1, 1)], [0, 1, 2, 3, 4]),  # past its start, and in again
        ([*SQUARE, (0, 0), (0, -0.5)], [0, 1, 2, 3]),  # on through its start
        ([(0, 0), (10, 0), (12, 0), (10, 0), (10, 10), (0, 10)], [0, 1, 4, 5]),  # there and back
        ([(0, 0), (5, 0), (5.5, 0.5), (5, 0.5), (5.5, 0), *SQUARE[1:]], [0, 1, 1, 4, 5, 6, 7]),
    ],
)
def test_small_tails_and_loops_are_cut(points, kept):
    ring = np.array(points, dtype=float)
    outline, numbers = mended(ring)
    assert np.floor(numbers).astype(int).tolist() == kept
    assert outline == pytest.approx(np.array([place(ring, number) for number in numbers]))
    assert area(points) == pytest.approx(100, rel=0.03)


def test_a_tail_that_leads_through_the_whole_is_cut_at_its_first_crossing():
    tail = [(5, 12), (5, 0)]
    points = [*tail, (10, 0), (10, 10), (0, 10), (0, 0.3), (5.1, 0.3)]
    outline, numbers = mended(np.array(points, dtype=float))
    assert outline.tolist() == [[5, 0.3], *[[*map(float, each)] for each in points[1:6]]]
    assert numbers[0] == pytest.approx(11.7 / 12)
    assert numbers[1:].tolist() == [1, 2, 3, 4, 5]


def test_what_was_cut_is_not_cut_again():
    # Two loops, of which the second crosses the first one: with that its crossings are gone.
    loops = [(4, 0), (4.6, 0.4), (4.2, 0.4), (4.8, -0.2), (4.3, 0.6), (6, 0)]
    outline, numbers = mended(np.array([(0, 0), *loops, *SQUARE[1:]], dtype=float))
    assert shapely.Polygon(outline).is_valid
    assert (np.diff(numbers) > 0).all()
    assert shapely.Polygon(outline).area == pytest.approx(100, rel=0.01)


@pytest.mark.parametrize(
    "points",
    [
        [(0, 0), (10, 10), (10, 0), (0, 10)],  # an eight
        [*SQUARE, (4, -4)],  # one with a small half
        [(0, 10), (6, -8), (-9.5, 3), (9.5, 3), (-6, -8)],  # a star
        [(0, 0), (10, 0), (5, 0)],  # a line
        [(1, 1), (1, 1), (1, 1), (1, 1)],
    ],
)
def test_an_outline_that_really_crosses_itself_is_refused(points):
    ring = np.array(points, dtype=float)
    outline, numbers = mended(ring)
    assert outline is ring
    assert numbers.tolist() == list(range(len(ring)))
    with pytest.raises(InvalidInputError, match=r"draw a zone (without crossing|around)"):
        Feature("zone", (ring,))


def test_an_outline_without_crossings_stays_as_it_is():
    ring = np.array(SQUARE, dtype=float)
    assert mended(ring)[0] is ring


@given(over=st.floats(0.0, 0.15), drift=st.floats(-0.08, 0.08), seed=st.integers(0, 999))
def test_an_ellipse_whose_pen_goes_on_past_its_start_is_mended(over, drift, seed):
    rng = np.random.default_rng(seed)
    turn = np.linspace(0.0, 2.0 * math.pi * (1.0 + over), 90)
    across = 1.0 + drift * turn / (2.0 * math.pi) + rng.normal(0.0, 0.004, 90)
    drawn = np.stack([30.0 * across * np.cos(turn), 20.0 * across * np.sin(turn)], axis=1)
    outline, numbers = mended(drawn)
    assert (np.diff(numbers) > 0).all()
    assert outline == pytest.approx(np.array([place(drawn, number) for number in numbers]))
    assert area(drawn) == pytest.approx(math.pi * 30 * 20, rel=0.25)


def test_a_scribble_is_soon_refused():
    scribble = np.random.default_rng(0).uniform(0.0, 1.0, (20_000, 2))
    with within(10):
        assert mended(scribble)[0] is scribble


def test_holes_are_mended_too():
    hole = [(4, 4), (6, 4), (6, 6), (4, 6), (4.1, 3.9)]
    zone = Feature("zone", (np.array(SQUARE), np.array(hole)))
    assert [len(ring) for ring in zone.rings] == [4, 4]
    assert [numbers.tolist()[1:] for numbers in zone.numbers] == [[1, 2, 3], [1, 2, 3]]
