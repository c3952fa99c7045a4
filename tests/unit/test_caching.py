"""Values computed once: no lock that instances of a class share, one value for all threads."""

import threading

import pytest

from sketchmatch import Scene
from sketchmatch.model.caching import cached_property

SQUARES = [[(x, 0), (x + 1, 0), (x + 1, 1)] for x in (0, 5)]


class Circle:
    def __init__(self, radius, meanwhile=lambda: None):
        self.radius, self.meanwhile, self.computed = radius, meanwhile, 0

    @cached_property
    def area(self):
        """Area in square metres."""
        self.meanwhile()
        self.computed += 1
        return [3 * self.radius**2]


def test_it_is_computed_once():
    circle = Circle(2)
    assert circle.area == [12]
    assert circle.area is circle.area
    assert circle.computed == 1
    assert Circle.area.__doc__ == "Area in square metres."


def test_one_that_takes_long_keeps_no_other_instance_waiting():
    may_end = threading.Event()
    slow = Circle(1, lambda: may_end.wait(20))
    thread = threading.Thread(target=lambda: slow.area)
    thread.start()
    areas = []
    other = threading.Thread(target=lambda: areas.append(Circle(2).area))
    other.start()
    other.join(10)
    was_done = not other.is_alive()
    may_end.set()
    thread.join(20)
    other.join(20)
    assert was_done
    assert slow.area == [3]


def test_threads_that_come_together_get_the_same_value():
    both = threading.Barrier(2, timeout=10)
    circle, seen = Circle(1, both.wait), []
    threads = [threading.Thread(target=lambda: seen.append(circle.area)) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20)
    assert seen[0] is seen[1] is circle.area
    assert circle.computed == 2


@pytest.mark.parametrize("name", ["edges", "identity"])
def test_scenes_keep_theirs(name):
    scene = Scene.from_polygons(SQUARES)
    assert getattr(scene, name) is getattr(scene, name)
    assert isinstance(vars(Scene)[name], cached_property)
