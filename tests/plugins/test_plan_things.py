"""What is drawn in plans: which closed lines may be things, and which of these stand in rooms."""

import numpy as np
import pytest

from sketchmatch.model import Landmark
from sketchmatch_builtin.segmenters._plan_things import dimensions, standing, things_in

CELLS = np.array([1.0, 0.0, 0.0])
ROOMS = np.zeros((20, 40), np.int32)
ROOMS[2:18, 2:18], ROOMS[2:18, 22:38] = 1, 2


def box(x, y, width, height):
    corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height), (x, y)]
    return np.array(corners, dtype=float)


THINGS = [box(4, 4, 2, 2), box(10, 10, 2, 2), box(24, 4, 2, 2), box(18.2, 9, 1, 1)]


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ([], [0, 1, 2]),
        ([(5, 5)], [0, 1, 2]),
        ([(5, 5), (11, 11)], [2]),  # these are called rooms
        ([(5, 5), (11, 11), (16, 16)], [0, 1, 2]),  # … but the place around them is one, too
        ([(5, 5), (11, 11), (30, 16)], [2]),
        ([(5, 5), (25, 5)], [0, 1, 2]),  # each in a room of its own
    ],
)
def test_things_stand_in_rooms_unless_they_are_called_rooms(names, expected):
    written = [Landmark("name", point, "room") for point in names]
    free = [[k] for k in range(len(THINGS))]
    assert standing(free, THINGS, written, ROOMS, CELLS) == expected


@pytest.mark.parametrize(("size", "stands"), [(11, True), (12, False)])
def test_what_fills_most_of_a_place_does_not_stand_in_it(size, stands):
    lines = [box(3, 3, size, size), THINGS[2]]
    assert standing([[0], [1]], lines, [], ROOMS, CELLS) == [0, 1][not stands :]


def things(*lines, names=()):
    found = things_in([box(0, 0, 100, 80), *lines], names)
    return found.free, found.touching


def test_a_thing_beside_one_that_touches_a_wall_touches_it_as_well():
    assert things(box(0, 20, 9, 9), box(9, 20, 9, 9)) == ([], [1, 2])
    assert things(box(10, 20, 9, 9), box(19, 20, 9, 9)) == ([[1, 2]], [])


def test_what_has_a_name_is_no_thing_if_it_touches_a_wall():
    closet = Landmark("closet", (5, 25), "room")
    assert things(box(0, 20, 9, 9), box(0, 40, 9, 9), names=[closet]) == ([], [2])
    assert things(box(1, 20, 9, 9), names=[closet]) == ([[1]], [])


@pytest.mark.parametrize(("thick", "count"), [(3.0, 1), (1.5, 0)])
def test_what_is_long_and_narrow_is_a_wall(thick, count):
    assert len(things(box(20, 20, 20, thick))[0]) == count


@pytest.mark.parametrize(("height", "count"), [(23, 1), (25, 0)])
def test_a_thing_covers_a_small_share_of_the_plan(height, count):
    assert len(things(box(20, 20, 20, height))[0]) == count


@pytest.mark.parametrize(("number", "count"), [(5, 5), (6, 0)])
def test_what_touches_walls_and_covers_much_of_the_plan_is_rooms(number, count):
    boxes = [box(16 * k, 0, 16, 29) for k in range(number)]
    assert len(things(*boxes)[1]) == count


@pytest.mark.parametrize(("length", "count"), [(6.0, 3), (4.0, 0)])
def test_what_is_too_short_is_no_dimension(length, count):
    ends = [np.array([(x, 49.9), (x, 50.1)]) for x in (50.0, 50.0 + length)]
    line = np.array([(50.0, 50.0), (50.0 + length, 50.0)])
    assert len(dimensions([box(0, 0, 100, 80), line, *ends])) == count
