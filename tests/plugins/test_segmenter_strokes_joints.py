"""What it costs to join two strokes, in numbers worked out by hand."""

import numpy as np
import pytest

from sketchmatch_builtin.segmenters._strokes_chains import _Search, closed_chains
from sketchmatch_builtin.segmenters._strokes_trace import traced

END = 1
"""Of the first stroke, where it ends; 2 is where the second begins."""


def joint(first, second):
    """Return how the end of a stroke is joined to the beginning of another."""
    strokes = [traced(np.array(each, float)) for each in (first, second)]
    (found,) = (each for each in _Search(strokes, [np.inf] * 2, 1.0).joints[END] if each.other == 2)
    return found


@pytest.mark.parametrize(
    ("second", "cost"),
    [
        ([(12, 0), (20, 0)], 2.0),  # straight on
        ([(12, 0), (12, -9)], 2.2),  # at a right angle
        ([(10, 2), (1, 2)], 2.4),  # back beside itself
    ],
)
def test_a_gap_costs_more_the_more_the_pen_turns(second, cost):
    found = joint([(0, 0), (10, 0)], second)
    assert found.cost == pytest.approx(cost)
    assert (found.gap, found.cut, found.other_cut) == (2.0, 0.0, 0.0)


def hooked(gap, tail):
    """Return a stroke that passes (10, 0), goes up by half its tail, and ends near to there."""
    return [(0, 0), (10, 0), (10, tail / 2), (10 + 1e-6, gap)]


@pytest.mark.parametrize(("gap", "cuts"), [(0.4, False), (0.6, True)])
def test_a_tail_is_cut_where_that_costs_less_than_the_gap(gap, cuts):
    # The tail is 2 long, so that to cut it costs a half.
    tail = 2.0 + gap
    found = joint(hooked(gap, tail), [(10, 0), (18, -8)])
    assert (found.cut > 1.5) == cuts
    assert (found.gap < 0.2) == cuts


@pytest.mark.parametrize(("over", "left"), [(4.2, 0.0), (4.8, 0.3), (6.0, 1.5)])
def test_no_more_of_a_stroke_is_cut_than_less_than_half_of_it(over, left):
    # Of a stroke of 10 up to 4.5 is cut.
    found = joint([(0, 0), (10, 0)], [(10 - over, 0), (10 - over, 9)])
    assert found.gap == pytest.approx(left, abs=1e-9)
    assert found.cut == pytest.approx(over - left)


@pytest.mark.parametrize(("over", "left"), [(1.6, 0.0), (2.4, 0.4)])
def test_of_a_stroke_that_winds_no_more_is_cut_than_half_its_width(over, left):
    # It is 4 wide and 16 long: of the last stretch up to 2 is cut, though .45 of it is 7.2.
    winding = [(4, 0), (0, 0), (4, 0.01), (0, 0.02), (4, 0.03)]
    found = joint(winding, [(4 - over, 0.03), (4 - over, 5)])
    assert found.gap == pytest.approx(left, abs=0.15)
    assert found.cut == pytest.approx(over - left, abs=0.2)


def test_what_is_cut_is_no_part_of_the_chain():
    over = [traced(np.array(each, float)) for each in ([(0, 0), (10, 0)], [(6, 0), (3, 6), (0, 0)])]
    (chain,) = closed_chains(over, [np.inf] * 2, 0.3)
    assert chain.line.length == pytest.approx(6 + 2 * np.hypot(3, 6), rel=0.02)
