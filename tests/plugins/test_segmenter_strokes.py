"""The segmenter of pen strokes: gaps, overshoots, outlines drawn twice, strokes left open."""

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.model import Stroke, StrokeSet
from sketchmatch_builtin.segmenters.strokes import StrokeSegmenter
from tests.interpreted import examples

TRIANGLE = [[20, 0], [24, 0], [22, 3], [20, 0]]


def segmented(*outlines, **params):
    strokes = tuple(
        outline if isinstance(outline, Stroke) else Stroke(np.array(outline, float))
        for outline in outlines
    )
    segmenter = StrokeSegmenter(StrokeSegmenter.Params(**params))
    return segmenter.segment(StrokeSet(strokes))


def circle(turns, inward=0.0, samples=200, start=0.0):
    """A circle of radius 1 that shrinks by a share of its radius with each turn."""
    t = np.linspace(0.0, turns, samples)
    radius = 1.0 - inward * t
    angle = 2 * np.pi * t + start
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def first_object(outline, **params):
    found = segmented(outline, TRIANGLE, **params)
    assert len(found.scene) == 2
    return found.scene.objects[0], found.warnings


def test_closed_outlines_become_objects_in_the_order_drawn():
    square = Stroke(np.array([[0, 0], [2, 0], [2, 2], [0, 2], [0, 0]], float), label="desk")
    found = segmented(square, TRIANGLE)
    assert found.scene.labels == ("desk", "")
    assert [item.area for item in found.scene.objects] == [4.0, 6.0]
    assert [len(item.rings[0]) for item in found.scene.objects] == [4, 3]
    assert found.warnings == ()


def test_a_gap_is_closed():
    item, warnings = first_object(circle(0.95))
    assert item.area == pytest.approx(np.pi, rel=0.03)
    assert warnings == ()


def test_tails_beyond_a_crossing_are_cut():
    square = [[0.0, -0.3], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [-0.3, 0.0]]
    item, _ = first_object(square)
    assert sorted(item.rings[0].tolist()) == [[0, 0], [0, 1], [1, 0], [1, 1]]


@pytest.mark.parametrize(
    ("outline", "least"),
    [
        (circle(1.3, inward=0.05), 0.85),  # runs on inside its own start
        (circle(1.3, inward=-0.05), 0.97),  # … and outside
        (circle(2.0, inward=0.02), 0.95),  # twice around
        (circle(2.4, inward=-0.02), 0.97),
    ],
)
def test_an_outline_drawn_over_twice_counts_once(outline, least):
    item, warnings = first_object(outline)
    assert least * np.pi < item.area < 1.25 * np.pi
    assert warnings == ()


def test_an_outline_that_wobbles_across_itself_counts_once():
    t = np.linspace(0, 4 * np.pi, 400)
    radius = 1 + 0.05 * np.sin(3.3 * t)
    item, warnings = first_object(np.stack([radius * np.cos(t), radius * np.sin(t)], axis=1))
    assert item.area == pytest.approx(np.pi, rel=0.08)
    assert len(item.rings) == 1
    assert warnings == ()


def test_a_flourish_on_the_way_does_not_close_the_outline():
    corner = [[3.0, 0.0], [3.3, 0.0], [3.3, 0.3], [3.0, 0.3], [3.0, -0.1], [3.0, 3.0]]
    item, _ = first_object([[0, 0], *corner, [0, 3], [0, 0.3]], simplify=0.0)
    assert item.area == pytest.approx(9.0, rel=0.03)


def test_a_figure_of_eight_keeps_its_larger_half_and_says_so():
    eight = [[0, 0], [4, 4], [4, 0], [0, 4], [-2, 2], [0, 0]]
    found = segmented(eight, TRIANGLE)
    assert found.scene.objects[0].area == pytest.approx(8.0)
    assert found.warnings == (
        "strokes[0] encloses separate areas, of which only the largest was taken.",
    )


def test_an_open_stroke_is_left_out_and_named():
    route = Stroke(np.array([[0, 5], [8, 5], [10, 7]], float), label="way")
    found = segmented(circle(1.0), route, TRIANGLE)
    assert len(found.scene) == 2
    assert found.warnings == (
        "strokes[1] (way) was left out: its ends are 102% of its size apart; close the outline "
        "or raise max_gap.",
    )


def test_a_line_there_and_back_is_left_out():
    found = segmented([[0, 0], [5, 0], [0, 0]], circle(1.0), TRIANGLE)
    assert found.warnings == (
        "strokes[0] (14% from the left, 75% from the top) was left out: it encloses nothing; draw "
        "around the object.",
    )


def test_max_gap_decides_what_is_open():
    outline = circle(0.9)  # a gap of 2·sin(18°) = 0.62, 31 % of its size
    assert len(segmented(outline, TRIANGLE, circle(1.0)).warnings) == 1
    assert segmented(outline, TRIANGLE, max_gap=0.35).warnings == ()


def test_strokes_that_stay_are_the_same_objects_whatever_is_drawn_beside_them():
    square = np.array([[0, 0], [2, 0], [2, 2], [0, 2.5], [0, 0]], float)
    before = segmented(Stroke(square, label="desk"), TRIANGLE).scene.objects
    moved, other = segmented(square + 3.0, TRIANGLE).scene.objects
    assert other is before[1]
    assert moved.rings[0].min() == 3.0
    renamed = segmented(Stroke(square.copy(), label="bed"), TRIANGLE).scene
    assert renamed.labels == ("bed", "")
    assert before[0].label == "desk"


def test_what_a_stroke_encloses_is_asked_anew_for_another_gap():
    open_ = circle(0.93)
    first_object(open_)
    with pytest.raises(InvalidInputError):
        segmented(open_, TRIANGLE, max_gap=0.2)
    assert first_object(open_)[1] == ()


@pytest.mark.slow
def test_a_stroke_of_very_many_points_is_not_kept():
    long = circle(1.0, samples=5000)
    first, again = (first_object(long, simplify=0.0)[0] for _ in range(2))
    assert first.area == again.area == pytest.approx(np.pi, rel=1e-3)
    assert first is not again


def test_simplify_is_relative_to_the_size():
    fine, _ = first_object(circle(1.0, samples=1000), simplify=0.0)
    coarse, _ = first_object(circle(1.0, samples=1000))
    larger, _ = first_object(1000.0 * circle(1.0, samples=1000))
    assert len(fine.rings[0]) in (999, 1000)
    assert 12 <= len(coarse.rings[0]) == len(larger.rings[0]) <= 40
    assert coarse.area == pytest.approx(fine.area, rel=0.03)


@pytest.mark.parametrize(
    ("outline", "field", "words"),
    [
        ([[3, 3], [4, np.nan]], "strokes[1].points[1]", "is not finite; give plain numbers"),
        ([[np.inf, 3], [4, 4]], "strokes[1].points[0]", "is not finite; give plain numbers"),
        ([[3, 3], [4, 4], [5, -1e200]], "strokes[1].points[2]", "is too large; give plain numbers"),
    ],
)
def test_a_stroke_that_leads_nowhere_is_refused(outline, field, words):
    with pytest.raises(InvalidInputError) as caught:
        segmented(circle(1.0), outline, TRIANGLE)
    assert (caught.value.field, caught.value.problem) == (field, words)
    assert caught.value.reason == Reason.INVALID_STROKE


@pytest.mark.parametrize("points", [[[4, -1]], [[4, -1], [4, -1]], [[4, -1]] * 5])
def test_a_tap_of_the_pen_is_left_out_and_told_by_its_place(points):
    found = segmented(circle(1.0), points, TRIANGLE)
    assert [len(found.scene), found.route] == [2, None]
    # From −1 to 24 and from 3 down to −1.
    assert found.warnings == (
        "strokes[1] (20% from the left, 100% from the top) was left out as a dot of the pen, which "
        "encloses nothing.",
    )


def test_many_taps_share_a_sentence_and_the_strokes_keep_their_numbers():
    taps = [[[x, 1.0]] for x in range(10)]
    found = segmented(*taps, np.empty((0, 2)), circle(1.0), [[0, 9], [0.01, 9]], TRIANGLE)
    empty, dots, flick = found.warnings
    assert empty == "strokes[10] was left out: it has no point."
    assert dots.startswith("strokes[0] (4% from the left, 80% from the top), strokes[1] (8% ")
    assert dots.endswith(" and 3 more were left out as a dot of the pen, which encloses nothing.")
    assert flick.startswith("strokes[12] (4% from the left, 0% from the top) was left out as far")


def test_strokes_of_no_points_share_a_sentence():
    found = segmented(np.empty((0, 2)), circle(1.0), np.empty((0, 2)), TRIANGLE)
    assert found.warnings == ("strokes[0] and 1 more were left out: they have no points.",)


def test_a_tap_that_is_called_a_route_is_none():
    found = segmented(circle(1.0), Stroke(np.array([[3.0, 3.0]]), label="route"), TRIANGLE)
    assert found.route is None
    assert found.warnings == (
        "strokes[1] (route) was left out as a dot of the pen, which encloses nothing.",
    )


def test_taps_alone_are_too_few():
    with pytest.raises(InvalidInputError) as caught:
        segmented([[0, 0]], [[1, 1], [1, 1]])
    assert caught.value.reason == Reason.TOO_FEW_OBJECTS
    assert "no closed outline (2 strokes were left out" in caught.value.problem


def test_too_few_objects_says_how_many_strokes_were_left_out():
    with pytest.raises(InvalidInputError) as caught:
        segmented(TRIANGLE, circle(0.6), [[0, 0], [1, 0]])
    assert caught.value.reason == Reason.TOO_FEW_OBJECTS
    assert str(caught.value) == (
        "strokes hold one closed outline (2 strokes were left out: open wider than 25% of the "
        "size, or only a line, or far smaller, or a mark in it, or the same again), and a match "
        "needs two; draw around each object with one stroke"
    )
    with pytest.raises(InvalidInputError, match="strokes hold no closed outline, and a match"):
        segmented()


@st.composite
def stars(draw):
    """A random star-shaped outline, its samples, and where along it the pen starts."""
    corners = draw(st.integers(4, 10))
    radii = draw(st.lists(st.floats(0.6, 1.0), min_size=corners, max_size=corners))
    angles = 2 * np.pi * np.arange(corners) / corners
    ring = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    outline = shapely.LinearRing(ring)
    return outline, draw(st.floats(0.0, 1.0))


def drawn(outline, start, share, drift=0.0):
    """Samples along a share of a ring's length, drifting outwards all along."""
    at = np.linspace(start, start + share, 240)
    points = shapely.get_coordinates(
        shapely.line_interpolate_point(outline, at % 1.0, normalized=True)
    )
    return points * (1.0 + drift * np.linspace(-0.5, 0.5, len(at)))[:, None]


def overlap(item, outline):
    # On a grid, because plain floating-point overlay fails on edges that all but coincide.
    both = (item.polygon, shapely.Polygon(outline))
    return (
        shapely.intersection(*both, grid_size=1e-9).area / shapely.union(*both, grid_size=1e-9).area
    )


@examples(200)
@given(stars(), st.floats(-0.1, 0.1), st.floats(-0.04, 0.04))
def test_gaps_and_overshoots_of_a_tenth_are_mended(star, overshoot, drift):
    outline, start = star
    size = max(np.ptp(shapely.get_coordinates(outline), axis=0))
    stroke = drawn(outline, start, 1.0 + overshoot * size / outline.length, drift)
    item, warnings = first_object(stroke)
    assert overlap(item, outline) > 0.9
    assert warnings == ()


def test_an_end_that_runs_along_the_beginning_is_mended():
    angles = np.pi / 2 * np.arange(4)
    radii = np.array([0.625, 0.8125, 1.0, 0.625])
    outline = shapely.LinearRing(np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1))
    stroke = drawn(outline, 0.84375, 1.0 + 0.0625 * 1.625 / outline.length)
    item, warnings = first_object(stroke)
    assert overlap(item, outline) > 0.9
    assert warnings == ()


@examples(50)
@given(stars(), st.floats(0.0, 6.3), st.floats(0.01, 100.0), st.tuples(*[st.floats(-9, 9)] * 2))
def test_the_result_turns_scales_and_moves_with_the_drawing(star, angle, scale, shift):
    outline, start = star
    stroke = drawn(outline, start, 0.97)
    c, s = np.cos(angle), np.sin(angle)
    moving = scale * np.array([[c, s], [-s, c]])
    # The bounding box is no measure that turns along, so nothing may depend on it here.
    still, _ = first_object(stroke, simplify=0.0)
    moved, _ = first_object(stroke @ moving + shift, simplify=0.0)
    expected = shapely.Polygon(still.rings[0] @ moving + shift)
    assume(expected.is_valid)
    assert moved.polygon.symmetric_difference(expected).area < 1e-6 * expected.area
