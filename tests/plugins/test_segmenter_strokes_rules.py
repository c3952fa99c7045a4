"""What each rule of the segmenter of strokes decides: on either side of its bound."""

import numpy as np
import pytest

from sketchmatch.model import Stroke, StrokeSet
from sketchmatch_builtin.segmenters.strokes import StrokeSegmenter


def found_in(*strokes, **params):
    drawn = tuple(Stroke(np.array(each, float)) for each in strokes)
    return StrokeSegmenter(StrokeSegmenter.Params(**params)).segment(StrokeSet(drawn))


def areas(found):
    return [item.area for item in found.scene.objects]


def box(x, y, width, height):
    right, top = x + width, y + height
    return [(x, y), (right, y), (right, top), (x, top), (x, y)]


def arc(start, end, radius=1.0):
    angles = np.radians(np.linspace(start, end, 60))
    return radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def loops(*widths, height=2.0):
    """The upper and the lower line of a row of loops, each as high as the others."""
    x, up, points = 0.0, height / 2.0, [(0.0, 0.0)]
    for width in widths:
        points += [(x + width / 2.0, up), (x + width, 0.0)]
        x, up = x + width, -up
    return np.array(points), np.array(points) * (1.0, -1.0)


AWAY = box(30, 0, 4, 4)


# One stroke


@pytest.mark.parametrize(("side", "told"), [(2.0, False), (3.0, True)])  # 4 and 8 % of all
def test_separate_areas_are_told_of_where_they_are_notable(side, told):
    bow = [(-10, 0), (-10, -10), (side, side), (side, -side), (-10, 10), (-10, 0)]
    found = found_in(bow, AWAY)
    assert areas(found) == pytest.approx([100.0, 16.0])
    assert ["separate areas" in each for each in found.warnings] == [True] * told


@pytest.mark.parametrize(("widths", "objects"), [((6.0, 2.0, 2.0), 3), ((4.5, 3.5, 2.0), 2)])
def test_loops_none_of_which_is_half_of_all_are_longhand(widths, objects):
    upper, lower = loops(*widths)
    found = found_in([*upper, *lower[::-1]], AWAY, box(30, 8, 4, 4))
    assert len(found.scene) == objects
    assert any("left out as longhand" in each for each in found.warnings) == (objects == 2)


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.0, 2.0])
def test_a_line_there_and_back_encloses_nothing_however_it_is_turned(angle):
    c, s = np.cos(angle), np.sin(angle)
    there = np.array([(0, 0), (2, 0), (5, 0), (3, 0), (1, 0), (0, 0)]) @ [[c, s], [-s, c]]
    found = found_in(there, AWAY, box(30, 8, 4, 4), route="never")
    assert areas(found) == pytest.approx([16.0, 16.0])


@pytest.mark.parametrize(("height", "expected"), [(1.3, [3.9]), (0.7, [])])  # 61 and 38 %
def test_a_stroke_is_closed_where_it_crosses_itself_if_that_is_most_of_it(height, expected):
    stroke = [(3, 3), (0, 3), (0, 0), (3, 0), (3, height), (-0.3, height)]
    found = found_in(stroke, AWAY, box(30, 8, 4, 4), route="never", simplify=0.0)
    assert areas(found) == pytest.approx([*expected, 16.0, 16.0])


def test_a_tail_far_longer_than_the_gap_is_no_tail():
    square = [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0.2)]
    straight = found_in([*square, (-1, 0.2)], AWAY, simplify=0.0)
    assert areas(straight)[0] == pytest.approx(16.0)
    winding = found_in([*square, (-1, 0.2), (-1, -0.6), (-0.5, -0.6)], AWAY, simplify=0.0)
    assert areas(winding)[0] == pytest.approx(16.65)


# Strokes that close together


@pytest.mark.parametrize(("apart", "objects"), [(0.05, 1), (0.5, 2)])
def test_strokes_open_wide_close_together_if_that_leaves_far_smaller_gaps(apart, objects):
    cup = [(0, 4), (0, 0), (0.9, 0), (0.9, 4)]
    lid = [(0, 4 + apart), (0, 8 + apart), (0.9, 8 + apart), (0.9, 4 + apart)]
    assert len(found_in(cup, lid, AWAY).scene) == objects + 1


def test_strokes_all_but_closed_are_objects_of_their_own():
    left = [(4, 2.06), (4, 4), (0, 4), (0, 0), (4, 0), (4, 1.94)]
    right = [(8.02 - x, y) for x, y in left]
    assert len(found_in(left, right, AWAY).scene) == 3


def test_tails_of_a_third_of_a_stroke_are_cut():
    # Of 11 units 3 each, and little more than a third of the strokes' spans.
    found = found_in([(-3, 0), (4, 0), (4, 4)], [(0, -3), (0, 4), (4, 4)], AWAY)
    assert areas(found) == pytest.approx([16.0, 16.0], rel=0.02)


def test_a_tail_is_not_cut_for_a_gap_that_is_a_little_smaller():
    half = np.array([(0.02, -4), (2, -4), (2, 0), (0.1, 0.5), (0.15, 2)])
    found = found_in(half, half * (-1, 1), AWAY)
    # A bottle with its neck.
    assert found.scene.objects[0].rings[0][:, 1].max() == pytest.approx(2.0)


def test_tails_that_cross_are_cut_at_the_crossing():
    found = found_in([(-1, 0), (4, 0), (4, 4), (-1, 4)], [(0, -1), (0, 5)], AWAY)
    assert areas(found) == pytest.approx([16.0, 16.0], rel=0.06)


@pytest.mark.parametrize(("reach", "area"), [(0.918, np.pi), (0.936, np.pi / 2.0)])
def test_a_stroke_goes_straight_on_over_a_gap_a_little_larger(reach, area):
    left, right = arc(93, 267), arc(-87, 87)  # 0.105 apart
    across = [(-0.05, reach), (-0.05, -reach)]  # 0.081 or 0.063 from the left, at a right angle
    found = found_in(left, right, across, AWAY, route="never")
    assert areas(found)[0] == pytest.approx(area, rel=0.1)


@pytest.mark.parametrize(("dash", "objects"), [(32, 3), (29, 2)])  # open by 29 % and by 36 %
def test_a_dashed_outline_may_be_open_by_30_percent(dash, objects):
    dashes = [arc(45 * k, 45 * k + dash) for k in range(8)]
    far = [box(9, 9, 1, 1), box(9, 12, 1, 1)]
    assert len(found_in(*dashes, *far, route="never").scene) == objects


def test_two_lines_close_to_a_bar_of_1_to_12():
    found = found_in([(0, 0), (12, 0)], [(0, 1), (12, 1)], AWAY)
    assert areas(found) == pytest.approx([12.0, 16.0])


@pytest.mark.parametrize(("radius", "objects"), [(0.7, 3), (0.8, 2)])  # 0.20 and 0.13 round
def test_a_thin_band_is_no_outline(radius, objects):
    band = arc(0, 270), arc(0, 270, radius)
    assert len(found_in(*band, box(9, 0, 1, 1), box(9, 3, 1, 1), route="never").scene) == objects


@pytest.mark.parametrize(("widths", "objects"), [((9.2, 0.8), 3), ((7.5, 2.5), 2)])
def test_strokes_that_cross_halfway_are_no_outline(widths, objects):
    found = found_in(*loops(*widths, height=6.0), AWAY, box(30, 8, 4, 4), route="never")
    assert len(found.scene) == objects


# What is no object


@pytest.mark.parametrize(("shift", "objects"), [(0.4, 2), (1.2, 3)])  # 82 and 54 % in common
def test_outlines_that_all_but_coincide_are_one(shift, objects):
    assert len(found_in(box(0, 0, 4, 4), box(shift, 0, 4, 4), AWAY).scene) == objects


@pytest.mark.parametrize(("side", "objects"), [(2.0, 2), (4.0, 3)])  # of a typical 10
def test_what_lies_inside_an_object_is_a_mark_if_it_is_small(side, objects):
    found = found_in(box(0, 0, 10, 10), box(20, 0, 10, 10), box(2, 2, side, side))
    assert len(found.scene) == objects


THINGS = [box(5, 5, 20, 20), box(40, 5, 20, 20), box(70, 5, 9, 9)]
WALLS = box(0, 0, 90, 90)
LOOSE = [[(50, 62), (50, 80), (68, 80), (68, 62)], [(54, 60), (64, 60)]]  # open by 13 %


@pytest.mark.parametrize(
    ("around", "things", "walls"),
    [
        ([WALLS], 3, 1),
        ([WALLS, box(100, 0, 90, 90), *[np.add(each, (100, 0)) for each in THINGS]], 6, 2),  # rooms
        ([WALLS, box(-5, -5, 200, 100), box(120, 40, 12, 12)], 4, 2),  # within a page
        ([WALLS, box(-3, -3, 96, 96)], 3, 1),  # a double line
        ([WALLS, box(100, 60, 30, 30), box(105, 65, 9, 9), box(105, 78, 9, 9)], 6, 1),  # a legend
        ([box(0, 0, 80, 30)], 3, 1),  # less than three times as large as the things, around all
        ([box(0, 0, 80, 26), box(100, 0, 60, 60)], 4, 0),  # … and not around all
        ([WALLS, *[box(300 * k, 300, 99, 99) for k in range(4)]], 5, 0),  # a large thing
        ([box(100, -40, 60, 60)], 4, 0),  # around nothing
        ([WALLS, *[box(40 * k, 120, 20, 20) for k in range(3)]], 6, 1),  # around half of them
        ([WALLS, *[box(40 * k, 120, 20, 20) for k in range(4)]], 8, 0),  # … and around fewer
    ],
)
def test_walls_around_far_smaller_things_are_left_out_and_these_are_no_marks_in_them(
    around, things, walls
):
    found = found_in(*around, *THINGS)
    assert len(found.scene) == things
    assert len(found_in(*around, *THINGS, frame="keep").scene) == things + walls
    assert ("set frame to 'keep'" in "".join(found.warnings)) == (walls > 0)


def test_walls_that_have_a_name_are_an_object():
    drawn = [Stroke(np.array(line, float)) for line in THINGS]
    walls = Stroke(np.array(WALLS, float), label="carpet")
    found = StrokeSegmenter().segment(StrokeSet((walls, *drawn)))
    assert found.scene.labels == ("carpet", "", "", "")


@pytest.mark.parametrize("strokes", [[box(50, 60, 5, 5)], LOOSE])
def test_what_stands_in_walls_is_an_object_as_it_is_without_them(strokes):
    assert len(found_in(*THINGS, *strokes).scene) == 4
    assert len(found_in(WALLS, *THINGS, *strokes).scene) == 4


def test_walls_around_a_single_thing_and_flicks_are_an_object_as_a_match_needs_two():
    flicks = [box(30 + 6 * k, 60, 3, 3) for k in range(3)]
    found = found_in(WALLS, box(5, 5, 40, 40), *flicks)
    assert [item.area for item in found.scene.objects] == [8100.0, 1600.0]


def test_a_route_within_walls_is_one_and_a_line_of_a_things_span_is_a_mark():
    route, leg = [(2, 50), (50, 40), (88, 50)], [(42, 7), (58, 20)]
    found = found_in(WALLS, *THINGS, leg, route)
    assert found.route.tolist() == np.array(route, float).tolist()
    assert any(
        "strokes[4] was left out as a mark or label inside strokes[2]" in each
        for each in found.warnings
    )


@pytest.mark.parametrize(("lines", "is_route"), [(3, True), (4, False)])
def test_of_many_straight_lines_across_the_sketch_none_is_the_route(lines, is_route):
    paper = [[(-300, -200 * k), (400, -200 * k)] for k in range(1, lines + 1)]
    found = found_in(box(0, 60, 20, 20), box(60, 60, 20, 20), *paper)
    assert (found.route is not None) == is_route
    bent = [(-300, 40), (30, 300), (100, 120), (400, 40)]
    assert found_in(*[box(0, 60, 20, 20), box(60, 60, 20, 20)], bent, *paper).route is not None


@pytest.mark.parametrize("names", [("", "desk", ""), ("", "", "desk"), ("desk", "table", "")])
def test_an_outline_drawn_again_is_called_as_any_of_them_the_first_before_all(names):
    outlines = [box(0, 0, 10, 10), box(0.1, 0.1, 9.8, 9.8), box(0.2, 0.2, 9.6, 9.6)]
    drawn = [Stroke(np.array(box(20, 0, 9, 9), float), label="bed")]
    drawn += [
        Stroke(np.array(line, float), label=name)
        for line, name in zip(outlines, names, strict=True)
    ]
    assert StrokeSegmenter().segment(StrokeSet(tuple(drawn))).scene.labels == ("bed", "desk")


@pytest.mark.parametrize(("gap", "objects"), [(0.56, 3), (1.2, 2)])  # open by 7 and by 15 %
def test_a_chain_inside_an_object_is_a_mark_if_it_is_loose(gap, objects):
    upper = [(3, 5 + gap), (3, 7), (7, 7), (7, 5 + gap)]
    lower = [(3, 5), (3, 3), (7, 3), (7, 5)]
    found = found_in(box(0, 0, 10, 10), box(20, 0, 10, 10), upper, lower)
    assert len(found.scene) == objects


def test_a_line_drawn_again_is_no_part_of_the_outline():
    left, right = arc(95, 265), arc(-85, 85)
    again = 0.96 * arc(-87, 87)  # nearer to the left half's ends, and shorter
    found = found_in(left, right, again, AWAY, route="never")
    assert found.scene.objects[0].rings[0][:, 0].max() == pytest.approx(1.0, abs=0.01)
    assert "strokes[2] was counted once" in found.warnings[0]


@pytest.mark.parametrize(("apart", "again"), [(0.28, True), (0.68, False)])  # 5 and 12 %
def test_a_stroke_near_an_outline_is_drawn_over_it_again(apart, again):
    found = found_in(box(0, 0, 4, 4), [(0, 4 + apart), (4, 4 + apart)], AWAY, route="never")
    (warning,) = found.warnings
    assert ("it was drawn again" in warning) == again


@pytest.mark.parametrize(("away", "again"), [(0.37, True), (1.2, False)])  # 5 and 20 % of it
def test_a_stroke_that_leaves_an_outline_is_not_drawn_over_it(away, again):
    stroke = [(0, 4.3), (4, 4.3), (4, 4.3 + away)]
    found = found_in(box(0, 0, 4, 4), stroke, AWAY, route="never")
    (warning,) = found.warnings
    assert ("it was drawn again" in warning) == again


@pytest.mark.parametrize(("end", "inside"), [(11.2, True), (13.5, False)])  # 12 and 28 % outside
def test_a_stroke_that_leaves_an_object_is_no_mark_in_it(end, inside):
    found = found_in(box(0, 0, 10, 10), [(1, 5), (end, 5)], AWAY, route="never")
    (warning,) = found.warnings
    assert ("as a mark or label inside strokes[0]" in warning) == inside


@pytest.mark.parametrize(("end", "is_route"), [(14.0, False), (20.0, True)])  # of 34
def test_a_route_leads_across_half_of_the_sketch(end, is_route):
    found = found_in(box(0, 0, 4, 4), AWAY, [(0, 8), (end, 8)])
    assert (found.route is not None) == is_route


def letter(x, y, size, is_open):
    turn = 200 if is_open else 360
    return arc(0, turn, size / 2) + np.array([x, y])


def word(x, y, size, shape, step=1.3):
    """A row of letters, o of them closed and c open."""
    return [letter(x + step * size * k, y, size, each == "c") for k, each in enumerate(shape)]


DESKS = [box(0, 0, 10, 8), box(20, 0, 10, 10), box(0, 20, 9, 9)]


@pytest.mark.parametrize(
    ("drawn", "objects"),
    [
        (word(0, -3, 2.0, "coo"), 3),
        (word(0, -3, 2.0, "ococ"), 3),
        (word(0, -3, 2.0, "oooo"), 7),  # four stools
        (word(0, -3, 2.0, "ooo") + word(20, -3, 2.0, "oooo"), 3),
        (word(0, -5, 3.2, "coo"), 3),
        (word(0, -5, 3.2, "ooo") + word(20, -5, 3.2, "ooo"), 9),
        (word(0, -8, 5.0, "coo"), 5),  # far too large for letters
        (word(0, -3, 2.0, "co"), 4),  # too few
        (word(0, -3, 2.0, "coo", step=2.0), 5),  # too far apart
        (word(0, -3, 2.0, "coo") + word(0, -5.5, 2.0, "coo") + word(0, -8, 2.0, "coo"), 9),
    ],
)
def test_small_strokes_in_a_row_are_writing(drawn, objects):
    found = found_in(*DESKS, *drawn)
    assert len(found.scene.objects) == objects
    said = [sentence for sentence in found.warnings if "left out as writing" in sentence]
    assert bool(said) == (objects == 3)


@pytest.mark.parametrize(("letters", "objects"), [("", 4), ("c", 4), ("cc", 3), ("co", 3)])
def test_a_small_object_drawn_in_four_strokes_is_one_letter_at_most(letters, objects):
    corners = [(0, -3), (2, -3), (2, -1.4), (0, -1.4), (0, -3)]
    sides = [corners[k : k + 2] for k in range(4)]
    found = found_in(*DESKS, *sides, *word(3.6, -2.2, 2.0, letters))
    assert len(found.scene.objects) == objects


def test_writing_alone_is_all_there_is():
    assert len(found_in(*word(0, 0, 2, "oococ"), box(20, 0, 12, 12)).scene.objects) == 4
