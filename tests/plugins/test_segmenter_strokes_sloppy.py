"""The segmenter of pen strokes on sketches of several strokes an object, marks and a route."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from sketchmatch.model import Stroke, StrokeSet
from sketchmatch.testing.sloppy import draw_sloppily
from sketchmatch_builtin.segmenters.strokes import StrokeSegmenter
from tests.interpreted import examples
from tests.pace import within

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4], [0, 0]]
AWAY = [[20, 0], [24, 0], [24, 4], [20, 4], [20, 0]]


def found_in(*strokes, **params):
    """What is found in strokes, each an array or a Stroke."""
    drawn = tuple(
        each if isinstance(each, Stroke) else Stroke(np.array(each, float)) for each in strokes
    )
    return StrokeSegmenter(StrokeSegmenter.Params(**params)).segment(StrokeSet(drawn))


def areas(found):
    return [item.area for item in found.scene.objects]


def overlap(a, b):
    a, b = shapely.make_valid(a), shapely.make_valid(b)
    return a.intersection(b).area / a.union(b).area


def missed_and_invented(sketch, found):
    """How many objects of a sketch were not recovered, and how many found are none."""
    shapes = [item.polygon for item in found.scene.objects]
    recovered = set()
    for item in sketch.truth.objects:
        matches = [k for k, shape in enumerate(shapes) if overlap(shape, item.polygon) > 0.8]
        recovered |= set(matches[:1])
    return len(sketch.truth) - len(recovered), len(shapes) - len(recovered)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sloppiness", "recovered", "marks", "invented"),
    [
        (0.0, 1.0, 0.0, 0),
        (0.05, 0.98, 0.0, 0),
        (0.10, 0.98, 0.0, 0),
        (0.15, 0.98, 0.0, 0.01),
        (0.20, 0.95, 0.0, 0.04),
        (0.15, 0.95, 0.4, 0.04),
    ],
)
def test_sloppy_objects_are_recovered(sloppiness, recovered, marks, invented):
    missed = made_up = total = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        sketch = draw_sloppily(rng, sloppiness=sloppiness, marks=marks, route=marks > 0)
        found = found_in(*sketch.strokes.strokes)
        lost, extra = missed_and_invented(sketch, found)
        missed, made_up, total = missed + lost, made_up + extra, total + len(sketch.truth)
        if sketch.route is not None:
            assert np.array_equal(found.route, sketch.strokes.strokes[sketch.route].points)
        else:
            assert found.route is None
    assert total >= 300
    assert missed <= (1.0 - recovered) * total
    assert made_up <= invented * total


@pytest.mark.slow
@examples(25)
@given(
    st.integers(0, 10_000),
    st.floats(0.0, 6.3),
    st.floats(0.01, 100.0),
    st.tuples(*[st.floats(-50.0, 50.0)] * 2),
    st.randoms(use_true_random=False),
)
def test_turn_scale_place_order_and_direction_change_nothing(seed, angle, scale, shift, random):
    sketch = draw_sloppily(np.random.default_rng(seed), 4, sloppiness=0.08, marks=0.3)
    still = [stroke.points for stroke in sketch.strokes.strokes]
    c, s = np.cos(angle), np.sin(angle)
    moving = scale * np.array([[c, s], [-s, c]])
    moved = [points[:: random.choice((1, -1))] @ moving + shift for points in still]
    random.shuffle(moved)
    # The box around a stroke does not turn with it, and the last of several may be the route.
    params = {"simplify": 0.0, "max_gap": 0.25, "route": "never"}
    before, after = found_in(*still, **params), found_in(*moved, **params)
    assert len(before.scene) == len(after.scene)
    shapes = [item.polygon for item in after.scene.objects]
    for item in before.scene.objects:
        expected = shapely.Polygon(item.rings[0] @ moving + shift)
        assert max(overlap(expected, shape) for shape in shapes) > 0.95


def test_four_sides_with_gaps_and_overshoots_are_one_object_with_its_first_label():
    sides = [
        Stroke(np.array([[-0.5, 0.0], [4.4, 0.0]])),
        Stroke(np.array([[0.0, 4.5], [0.0, -0.5]]), label="rug"),
        Stroke(np.array([[3.7, 4.0], [0.3, 4.0]]), label="mat"),
        Stroke(np.array([[4.0, 0.3], [4.0, 3.6]])),
    ]
    found = found_in(AWAY, *sides)
    assert found.scene.labels == ("", "rug")
    assert overlap(found.scene.objects[1].polygon, shapely.box(0, 0, 4, 4)) > 0.97
    assert found.warnings == ()


def test_a_stroke_across_an_object_leaves_it_whole():
    found = found_in(SQUARE, [[-2, 2], [6, 2.2]], AWAY)
    assert areas(found) == [16.0, 16.0]
    assert found.warnings[0].startswith("strokes[1] (15% from the left, 48% from the top) was left")


def test_an_outline_drawn_again_counts_once():
    again = np.array(SQUARE) + 0.1
    side = [[0.1, 0.1], [2.0, -0.1], [3.9, 0.1]]
    found = found_in(SQUARE, again, side, AWAY)
    assert areas(found) == [16.0, 16.0]
    assert len(found.warnings) == 1
    assert "strokes[2]" in found.warnings[0]
    assert "counted once with strokes[" in found.warnings[0]


def test_marks_inside_an_object_and_flicks_are_left_out():
    cross = ([[1, 1], [3, 3]], [[1, 3], [3, 1]])
    dot = np.array(SQUARE) * 0.02 + 8.0
    flick = [[10, 10], [10.1, 10.2]]
    found = found_in(SQUARE, *cross, dot, flick, AWAY)
    assert areas(found) == [16.0, 16.0]
    assert found.warnings == (
        "strokes[1] and strokes[2] were left out as a mark or label inside strokes[0].",
        "strokes[3] (34% from the left, 21% from the top) and strokes[4] (42% from the left, 1% "
        "from the top) were left out as far smaller than the objects.",
    )


def test_a_closed_shape_inside_another_is_an_object_and_reported():
    room = np.array(SQUARE) * 3.0
    found = found_in(room, np.array(SQUARE) + 2.0, AWAY)
    assert sorted(areas(found)) == [16.0, 16.0, 144.0]
    assert found.warnings == ("strokes[1] inside strokes[0] was taken as an object, too.",)


def test_a_route_is_kept_apart():
    way = np.array([[2.0, 8.0], [12.0, 10.0], [22.0, 8.0]])
    found = found_in(SQUARE, AWAY, way)
    assert np.array_equal(found.route, way)
    assert len(found.scene) == 2
    assert found.warnings == (
        "strokes[2] was taken as the route, which is open and goes across much of the sketch.",
    )
    never = found_in(SQUARE, AWAY, way, route="never")
    assert never.route is None
    assert (
        "strokes[2] (50% from the left, 10% from the top) was left out: its ends"
        in (never.warnings[0])
    )


def test_a_labelled_route_may_be_short_and_anywhere():
    way = Stroke(np.array([[2.0, 8.0], [4.0, 9.0]]), label="Route 1")
    found = found_in(way, SQUARE, AWAY, [[2, 9], [12, 12], [22, 9]])
    assert np.array_equal(found.route, way.points)
    assert len(found.warnings) == 1


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["arcs", "words", "one place"])
def test_two_thousand_strokes_are_quick(kind):
    rng = np.random.default_rng(0)
    t = np.linspace(0.0, 1.0, 60)
    strokes = [SQUARE, AWAY]
    for _ in range(2000):
        a = rng.uniform(0.0, 6.0) + rng.uniform(1.0, 3.0) * t
        arc = np.stack([np.cos(a), np.sin(a)], axis=1)
        word = np.stack([3.0 * t, 0.5 * np.sin(18.0 * t)], axis=1)
        place = rng.uniform(0.0, 0.1 if kind == "one place" else 30.0, 2)
        strokes.append((word if kind == "words" else arc) + place)
    with within(8.0):  # 1 to 3.5 s
        assert len(found_in(*strokes).scene) >= 2


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["apart", "one place", "tangles"])
def test_two_thousand_scribbles_are_quick_and_objects_among_them_are_found(kind):
    rng = np.random.default_rng(0)
    scribbles = []
    for _ in range(2000):
        if kind == "tangles":
            points = rng.uniform(0.0, 1.0, (60, 2))
        else:
            points = rng.normal(size=(60, 2)).cumsum(axis=0)
        scribbles.append(points + rng.uniform(-1e3, 1e3, 2) * (kind == "apart"))
    big = [5000.0 + 20.0 * np.array(each) for each in (SQUARE, AWAY)]
    with within(6.0):  # below 2 s
        found = found_in(*scribbles, *big)
    assert {1600.0 * 4.0} <= set(np.round(areas(found), 6))
    assert any("cross themselves too often to look at them all" in each for each in found.warnings)


@pytest.mark.parametrize(("side", "objects"), [(0.7, 2), (0.3, 3)])
def test_several_strokes_within_an_object_go_over_it_again_unless_they_are_small(side, objects):
    def box(x, size):
        return np.array([(x, x), (x + size, x), (x + size, x + size), (x, x + size), (x, x)])

    inner = box(0.1, side)
    sketch = [box(0.0, 1.0), box(3.0, 1.0), inner[:3], inner[2:]]
    found = StrokeSegmenter().segment(StrokeSet(tuple(map(Stroke, sketch))))
    assert len(found.scene) == objects
    again = any("it was drawn again" in warning for warning in found.warnings)
    assert again == (objects == 2)
