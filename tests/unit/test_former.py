"""Where a search begins in a sketch that was changed."""

import numpy as np

from sketchmatch.model import Scene
from sketchmatch.pipeline.former import Former, starts

BOX = np.array([[0.0, 0.0], [1.0, 0.0], [1.3, 0.7], [0.0, 1.0]])


def scene(*places):
    return Scene.from_polygons([BOX + np.array([5.0 * place, 0.0]) for place in places])


def test_an_object_that_moved_is_another_one():
    former = Former(scene(0, 1, 2), ({0: 4, 1: 3, 2: 0},), None)
    (start,) = starts(former, scene(2, 0, 7), map_objects=5, swapped=False)
    assert start.tolist() == [0, 4, -1]


def test_a_map_read_from_the_map_is_turned_round():
    former = Former(scene(0, 1, 2), ({0: 1, 2: 0},), None)
    (start,) = starts(former, scene(2, 7, 0), map_objects=2, swapped=True)
    assert start.tolist() == [0, 2]


def test_maps_that_say_the_same_of_what_is_left_are_one():
    former = Former(scene(0, 1, 2), ({0: 4, 1: 3, 2: 0}, {0: 4, 1: 3, 2: 1}, {0: 3, 1: 4}), None)
    found = starts(former, scene(0, 1), map_objects=5, swapped=False)
    assert [each.tolist() for each in found] == [[4, 3], [3, 4]]


def test_one_line_is_no_place_to_begin():
    assert starts(Former(scene(0, 1), ({0: 4, 1: 3},), None), scene(1, 2), 5, False) == ()
