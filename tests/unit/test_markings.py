"""Points, routes and zones in pictures: on both sides, and how sure they are."""

import numpy as np
import pytest

from sketchmatch.model import Scene
from sketchmatch.pictures.overlay import Marking, OverlayMatch, draw_overlay

SCENE = Scene.from_polygons(
    [
        [(0, 0), (1, 0), (1, 1), (0, 1)],
        [(9, 0), (10, 0), (10, 1), (9, 1)],
        [(4, 9), (6, 9), (6, 10), (4, 10)],
    ]
)
MATCHES = [OverlayMatch(k, k, 1.0) for k in range(3)]
ROUTE = np.array([[2.0, 3.0], [5.0, 5.0], [8.0, 3.0]])
ZONE = np.array([[3.0, 3.0], [7.0, 3.0], [7.0, 7.0], [3.0, 7.0]])


def drawn(sketch=(), map_=()):
    picture = draw_overlay(SCENE, SCENE, MATCHES, markings=(sketch, map_), width=800)
    return np.asarray(picture, dtype=int)


@pytest.fixture(scope="module")
def plain():
    return drawn()


def changed(picture, plain):
    """Return how many pixels are others in the left and in the right half."""
    other = np.abs(picture - plain).max(axis=2) > 8
    middle = other.shape[1] // 2
    return int(other[:, :middle].sum()), int(other[:, middle:].sum())


@pytest.mark.parametrize(
    ("kind", "rings"),
    [("route", (ROUTE,)), ("zone", (ZONE,)), ("point", (ROUTE[:1],))],
)
def test_each_kind_is_drawn_on_the_side_that_it_is_on(plain, kind, rings):
    marking = Marking(kind, rings)
    left, right = changed(drawn([marking]), plain), changed(drawn((), [marking]), plain)
    assert left[0] > 20
    assert right[1] > 20
    assert (left[1], right[0]) == (0, 0)


def test_a_shade_is_as_wide_as_two_deviations(plain):
    narrow, wide = (
        changed(drawn((), [Marking("route", (ROUTE,), (np.full(3, sure),))]), plain)[1]
        for sure in (0.2, 0.4)
    )
    bare = changed(drawn((), [Marking("route", (ROUTE,))]), plain)[1]
    assert bare < narrow < wide
    assert wide > 1.6 * narrow


def test_a_shade_does_not_leave_its_panel(plain):
    picture = drawn((), [Marking("route", (ROUTE,), (np.full(3, 100.0),))])
    left, right = changed(picture, plain)
    assert left == 0
    assert right > 1000
    assert (picture[:40] == plain[:40]).all()


def test_a_name_is_written(plain):
    bare, named = (
        changed(drawn([Marking("zone", (ZONE,), (), name)]), plain)[0] for name in ("", "no-go")
    )
    assert named > bare
