"""What must hold of ways that people draw, and of zones of old maps on new ones."""

import numpy as np
import pytest

from tests.experiments.carrying import PEOPLE, carried_ways, carried_zones


@pytest.mark.slow
@pytest.mark.parametrize("people", PEOPLE)
def test_ways_pass_things_on_the_drawn_side_near_the_true_way_and_through_none(people):
    found = carried_ways(people, range(20))
    assert found.ways >= 12
    assert found.passings > 80
    assert found.same_side >= 0.97 * found.passings
    assert found.through == 0
    assert np.median(found.away) < 0.5
    misses = np.concatenate(found.standardised)
    assert 0.65 < (misses < 1.0).mean() < 0.97
    assert (misses < 2.0).mean() > 0.9


@pytest.mark.slow
def test_zones_of_old_maps_lie_right_on_new_ones():
    shares = [share for found in carried_zones(range(2)) for share in found]
    assert np.median(shares) >= 0.9


@pytest.mark.slow
def test_where_a_sketch_grows_to_one_side_a_warp_keeps_what_no_similarity_keeps():
    found = carried_ways("uneven", range(40))
    assert found.passings > 170
    assert found.passings - found.same_side <= 1 < found.passings - found.stiff_same_side
    assert found.through == 0 < found.stiff_through
    assert np.median(found.away) < 0.75 * np.median(found.stiff_away)
