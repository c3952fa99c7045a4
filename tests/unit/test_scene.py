"""Scenes: what an object may be, how it is kept, and how each fault is told."""

import math

import numpy as np
import pytest
import shapely

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io import read_source
from sketchmatch.model import Scene, SceneObject

SQUARE = [[0, 0], [2, 0], [2, 2], [0, 2]]
HOLE = [[0.5, 0.5], [1.5, 0.5], [1.5, 1.5], [0.5, 1.5]]
TRIANGLE = [[3, 0], [5, 0], [4, 2]]


def test_an_object_has_the_area_and_centroid_of_its_rings():
    item = SceneObject.from_rings([SQUARE, HOLE])
    assert item.area == pytest.approx(3.0)
    assert item.centroid == pytest.approx((1.0, 1.0))
    assert item.polygon.area == pytest.approx(3.0)


@pytest.mark.parametrize("outer", [SQUARE, SQUARE[::-1], [*SQUARE, SQUARE[0]]])
@pytest.mark.parametrize("hole", [HOLE, HOLE[::-1]])
def test_rings_are_kept_open_outer_counter_clockwise_holes_clockwise(outer, hole):
    item = SceneObject.from_rings([outer, hole])
    assert [len(ring) for ring in item.rings] == [4, 4]
    x, y = item.rings[0].T
    assert np.dot(x, np.roll(y, -1)) > np.dot(y, np.roll(x, -1))
    x, y = item.rings[1].T
    assert np.dot(x, np.roll(y, -1)) < np.dot(y, np.roll(x, -1))


def test_repeated_points_count_once_and_collinear_ones_stay():
    item = SceneObject.from_rings([[[0, 0], [0, 0], [1, 0], [2, 0], [2, 2], [2, 2], [0, 2]]])
    assert len(item.rings[0]) == 5


def test_rings_cannot_be_written_to_and_the_callers_array_stays_his():
    given = np.array(SQUARE, dtype=float)
    item = SceneObject.from_rings([given])
    given[0] = 99.0
    assert item.rings[0].max() == 2.0
    with pytest.raises(ValueError, match="read-only"):
        item.rings[0][0] = 1.0


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1e6, 1e12])
def test_size_does_not_decide_whether_a_polygon_is_one(scale):
    item = SceneObject.from_rings([scale * np.array(TRIANGLE, dtype=float)])
    assert item.area == pytest.approx(2.0 * scale**2)


def test_a_small_object_far_from_the_origin_keeps_its_area():
    assert SceneObject.from_rings([np.array(SQUARE) + 1e7]).area == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("rings", "field", "words"),
    [
        ([], "rings", "at least an outer ring"),
        ([[[0, 0], [1, 1]]], "rings[0]", "2 distinct points"),
        ([[[0, 0], [1, 1], [0, 0]]], "rings[0]", "2 distinct points"),
        ([[[0, 0], [1, 1], [2, 2]]], "", "has no area"),
        ([[[0, 0], [1, 0], [1, 1e-12]]], "", "has no area"),
        ([[[0, 0], [2, 2], [2, 0], [0, 2]]], "", "crosses itself"),
        ([[[0, 0], [np.nan, 1], [1, 0]]], "rings[0].points[1]", "not finite"),
        ([[[0, 0], [1, 1], [np.inf, 0]]], "rings[0].points[2]", "not finite"),
        ([[[0, 0, 0], [1, 1, 1], [2, 0, 0]]], "rings[0]", "[x, y] pairs"),
        ([["a", "b"]], "rings[0]", "[x, y] pairs"),
        ([np.array([[0, 0], [1, 1j], [2, 0]])], "rings[0]", "[x, y] pairs of numbers"),
        ([[[0, 0], [1], [2, 0]]], "rings[0]", "[x, y] pairs"),
        ([[]], "rings[0]", "[x, y] pairs"),
        ([SQUARE, [[5, 5], [6, 5], [6, 6]]], "", "keep holes inside"),
        ([SQUARE, HOLE, [[1, 1], [1.8, 1], [1.8, 1.8]]], "", "or a hole at (1.5, 1.5)"),
        ([SQUARE, SQUARE], "", "or a hole"),
    ],
)
def test_a_polygon_that_cannot_be_used_is_refused_with_its_place(rings, field, words):
    with pytest.raises(InvalidInputError) as caught:
        SceneObject.from_rings(rings)
    assert caught.value.reason is Reason.INVALID_POLYGON
    assert caught.value.field == field
    assert words in caught.value.problem


def test_a_scene_takes_rings_and_lists_of_rings():
    scene = Scene.from_polygons([SQUARE, [SQUARE, HOLE], np.array(TRIANGLE)], ["a", "", "c"])
    assert len(scene) == 3
    assert scene.labels == ("a", "", "c")
    assert [item.area for item in scene.objects] == pytest.approx([4.0, 3.0, 2.0])
    assert scene.bounds == (0.0, 0.0, 5.0, 2.0)


def test_an_object_takes_the_polygons_of_shapely_with_their_holes():
    frame = shapely.Polygon([(0, 0, 7), (0, 4, 7), (6, 4, 7), (6, 0, 7)])
    frame = frame.difference(shapely.box(1, 1, 3, 3)).difference(shapely.box(4, 1, 5, 2))
    assert frame.has_z
    item = SceneObject.from_polygon(frame, "frame")
    assert [len(ring) for ring in item.rings] == [4, 4, 4]
    assert item.area == 24 - 4 - 1
    assert item.polygon.equals(frame)
    assert item.label == "frame"


@pytest.mark.parametrize(
    "shape",
    [shapely.LinearRing([(0, 0), (2, 0), (0, 2)]), shapely.MultiPolygon([shapely.box(0, 0, 2, 1)])],
)
def test_a_shape_of_shapely_that_is_one_outline_is_an_object(shape):
    assert SceneObject.from_polygon(shape).area == 2.0


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        (
            shapely.union_all([shapely.box(0, 0, 1, 1), shapely.box(3, 0, 4, 1)]),
            "polygons[1] has 2 parts, but an object has one outline; make an object of each of its "
            ".geoms, or take its convex_hull",
        ),
        (shapely.Polygon(), "polygons[1] is an empty Polygon; leave it out"),
        (shapely.MultiPolygon(), "polygons[1] is an empty MultiPolygon; leave it out"),
        (
            shapely.LineString([(0, 0), (1, 0), (1, 1)]),
            "polygons[1] is a LineString, which has no area; give a Polygon",
        ),
        (
            shapely.Polygon([(0, 0), (2, 2), (2, 0), (0, 2)]),
            "polygons[1] crosses itself at (1, 1); draw its outline without crossing",
        ),
        (
            shapely.Polygon([(0, 0), (float("inf"), 2), (2, 0)]),
            "polygons[1].rings[0].points[1] is not finite; give plain numbers",
        ),
    ],
)
def test_a_shape_of_shapely_that_is_not_one_polygon_is_refused(shape, words):
    with pytest.raises(InvalidInputError) as refused:
        Scene.from_polygons([shapely.box(0, 0, 1, 1), shape])
    assert refused.value.reason is Reason.INVALID_POLYGON
    assert str(refused.value) == words


@pytest.mark.parametrize(("polygons", "words"), [([], "no object"), ([SQUARE], "one object")])
def test_a_scene_has_at_least_two_objects(polygons, words):
    with pytest.raises(InvalidInputError, match=words) as caught:
        Scene.from_polygons(polygons)
    assert caught.value.reason is Reason.TOO_FEW_OBJECTS


def test_polygons_come_in_whatever_can_be_gone_through():
    scene = Scene.from_polygons((SQUARE for _ in range(3)), labels=iter("abc"))
    assert scene.labels == ("a", "b", "c")


@pytest.mark.parametrize("given", [None, 5, np.array(5)])
def test_what_holds_no_polygons_or_labels_is_refused(given):
    with pytest.raises(InvalidInputError, match=r"^polygons is .*; give a list of polygons$"):
        Scene.from_polygons(given)
    if given is not None:
        with pytest.raises(InvalidInputError, match=r"^labels is .*; give a list of labels$"):
            Scene.from_polygons([SQUARE, TRIANGLE], labels=given)


def test_a_bad_polygon_is_named_by_its_place_in_the_scene():
    with pytest.raises(InvalidInputError) as caught:
        Scene.from_polygons([SQUARE, [SQUARE, [[0, 0], [1, np.nan], [1, 0]]]])
    assert caught.value.field == "polygons[1].rings[1].points[1]"


def test_labels_may_be_numbers_and_none():
    given = [0, True, None, math.nan, 1.5, np.int64(3), np.bool_(False), np.str_("desk")]
    shapes = [SQUARE] * len(given)
    labels = ("0", "True", "", "", "1.5", "3", "False", "desk")
    for several in (given, tuple(given), np.array(given, dtype=object)):
        assert Scene.from_polygons(shapes, labels=several).labels == labels
    assert Scene.from_polygons(shapes[:2], labels=np.array([0, 1])).labels == ("0", "1")
    assert all(type(label) is str for label in Scene.from_polygons(shapes, given).labels)
    assert SceneObject.from_rings([SQUARE], 0).label == "0"


@pytest.mark.parametrize("label", [b"desk", ["desk"], {"name": "desk"}, np.array([1, 2])])
def test_what_is_no_label_is_refused(label):
    with pytest.raises(InvalidInputError, match="; give text or a number") as caught:
        Scene.from_polygons([SQUARE, TRIANGLE], labels=["", label])
    assert caught.value.field == "polygons[1].label"
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("labels", ["ab", b"ab", {0: "a", 1: "b"}])
def test_labels_are_a_list(labels):
    with pytest.raises(InvalidInputError, match="give a list of names") as caught:
        Scene.from_polygons([SQUARE, TRIANGLE], labels=labels)
    assert caught.value.field == "labels"


def test_a_scene_shows_itself_in_a_line():
    scene = Scene.from_polygons([SQUARE, TRIANGLE], labels=["desk", "a plant"])
    x0, y0, x1, y1 = scene.bounds
    size = f"{x1 - x0:.3g} x {y1 - y0:.3g}"
    assert repr(scene) == str(scene) == f"<Scene: 2 objects, {size}: desk, a plant>"
    unnamed = Scene.from_polygons([SQUARE] * 9)
    assert repr(unnamed) == "<Scene: 9 objects, 2 x 2>"
    many = Scene.from_polygons([SQUARE] * 9, labels=range(9))
    assert repr(many) == "<Scene: 9 objects, 2 x 2: 0, 1, 2, 3, 4, ...>"
    assert len(repr(Scene.from_polygons([SQUARE] * 9, labels=["long " * 999] * 9))) < 250


def test_an_object_shows_itself_in_a_line():
    item = SceneObject.from_polygon([SQUARE, HOLE], "desk")
    assert repr(item).startswith(f"<SceneObject: desk, 8 vertices, area {item.area:.3g}, around (")


def test_a_scene_is_a_picture_in_a_notebook(tmp_path):
    scene = Scene.from_polygons(
        [[SQUARE, HOLE], TRIANGLE, np.add(TRIANGLE, 5.0)], ["<desk>", "", "plant"]
    )
    file = tmp_path / "scene.svg"
    file.write_text(scene._repr_svg_(), encoding="utf-8")
    strokes = read_source(file).strokes
    drawn = [stroke.points[:-1] for stroke in strokes]
    rings = [ring for item in scene.objects for ring in item.rings]
    assert len(drawn) == len(rings)
    for points, ring in zip(drawn, rings, strict=True):
        lowest = points.min(axis=0) - ring.min(axis=0)
        np.testing.assert_allclose(points - lowest, ring, rtol=0, atol=1e-5)
    assert [stroke.label for stroke in strokes] == ["0 <desk>", "0 <desk>", "1", "2 plant"]


def test_labels_come_one_for_each_polygon():
    with pytest.raises(InvalidInputError, match="1 names for 2 polygons") as caught:
        Scene.from_polygons([SQUARE, TRIANGLE], labels=["a"])
    assert caught.value.field == "labels"
