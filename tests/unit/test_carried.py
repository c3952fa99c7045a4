"""Features carried: what is kept of them, and routes that are kept out of obstacles."""

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

from sketchmatch.errors import InvalidInputError
from sketchmatch.model import OccupancyGrid, Scene
from sketchmatch.pipeline.slices import finish
from sketchmatch.transfers.carrying import carried, course_between
from sketchmatch.transfers.features import ChangeReason, Feature, FeatureKind
from sketchmatch.transfers.obstacles import Obstacles, sampled
from tests.interpreted import examples


def box(x, y, width=1.0, height=1.0):
    corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)]
    return [(x + dx, y + dy) for dx, dy in corners]


SCENE = Scene.from_polygons(
    [box(0, 0), box(9, 0), box(0, 9), box(9, 9), box(4, 4, 2, 2)], ["", "", "", "", "table"]
)
SAME = [(k, k) for k in range(5)]
TURNED = Scene.from_polygons([[(-2.0 * y, 2.0 * x) for x, y in o.rings[0]] for o in SCENE.objects])


def route(*points, speeds=None, name=""):
    return Feature(FeatureKind.ROUTE, (np.array(points, dtype=float),), name, speeds)


def floor(rows=100, columns=100, resolution=0.1, walls=(), unknown=()):
    """Return a grid with walls and unknown cells, each a slice of rows and one of columns."""
    cells = np.zeros((rows, columns), dtype=np.int8)
    for where in unknown:
        cells[where] = -1
    for where in walls:
        cells[where] = 100
    return OccupancyGrid(cells, resolution)


def led(feature, grid, radius=0.2, allow_unknown=False):
    """Carry a feature onto a grid by a warp that changes nothing."""
    course = course_between(SCENE, SCENE, SAME, features=[feature])
    obstacles = Obstacles.of_grid(grid, allow_unknown)
    (found,) = finish(carried([feature], course, obstacles, radius, "m"))
    return found, obstacles


def distance(found, grid):
    """Return how near a carried route comes to what is not free, cell by cell."""
    size = grid.resolution
    taken = [
        shapely.box(x * size, y * size, (x + 1) * size, (y + 1) * size)
        for y, x in np.argwhere(grid.cells)
    ]
    return shapely.LineString(found.feature.points).distance(shapely.union_all(taken))


def reasons(found):
    return [change.reason for change in found.changes]


def test_points_routes_and_zones_are_carried_in_their_order_with_names_and_speeds():
    zone = Feature(FeatureKind.ZONE, (np.array(box(1, 1, 4, 4)), np.array(box(2, 2))), "no-go")
    features = [
        route((1, 2), (8, 2), (8, 8), speeds=[0.5, 0.2, 0.1], name="patrol"),
        Feature(FeatureKind.POINT, (np.array([[3.0, 7.0]]),), "dock"),
        zone,
    ]
    found = finish(carried(features, course_between(SCENE, TURNED, SAME, features=features)))
    assert [each.feature.name for each in found] == ["patrol", "dock", "no-go"]
    assert [each.kind for each in found] == ["route", "point", "zone"]
    way, dock, area = (each.feature for each in found)
    given_ = [int(k) for k in found[0].sources[0] if k == int(k)]
    assert given_ == [0, 1, 2]
    assert way.points[[0, -1]] == pytest.approx(np.array([[-4, 2], [-16, 16]]), abs=1e-6)
    assert way.speeds[0] == 0.5
    assert way.speeds[-1] == 0.1
    assert dock.points == pytest.approx(np.array([[-14.0, 6.0]]), abs=1e-6)
    expected = shapely.Polygon([(-2 * y, 2 * x) for x, y in box(1, 1, 4, 4)]).difference(
        shapely.Polygon([(-2 * y, 2 * x) for x, y in box(2, 2)])
    )
    there = shapely.Polygon(area.rings[0], area.rings[1:])
    assert there.symmetric_difference(expected).area < 1e-6 * expected.area
    assert [len(each) for each in found[2].deviations] == [len(ring) for ring in area.rings]


def test_a_zone_that_was_mended_tells_which_of_the_given_points_are_left():
    drawn = [*box(1, 1, 4, 4), (1.2, 0.8)]
    (found,) = finish(
        carried([Feature("zone", (np.array(drawn),))], course_between(SCENE, TURNED, SAME))
    )
    outline, numbers = found.feature.points, found.sources[0]
    assert len(outline) == len(numbers) == len(found.deviations[0])
    assert outline[numbers == 2] == pytest.approx(np.array([[-10.0, 10.0]]), abs=1e-6)
    assert np.floor(numbers).tolist() == sorted(np.floor(numbers))
    assert {1, 2, 3} <= set(numbers.tolist())
    assert 0 < numbers.min() < numbers.max() < 4  # the beginning and the end were cut


def test_a_straight_line_gets_no_more_points_than_it_needs():
    feature = route((1, 2), (8, 2), (8, 8))
    (found,) = finish(carried([feature], course_between(SCENE, TURNED, SAME)))
    assert len(found.feature.points) == 3


def test_a_bent_line_gets_the_points_that_it_needs():
    bent = Scene.from_polygons([box(0, 0), box(9, 0), box(0, 9), box(9, 9), box(4, 5.5, 2, 2)])
    feature = route((0.5, 5.0), (9.5, 5.0))
    course = course_between(SCENE, bent, SAME, features=[feature])
    (found,) = finish(carried([feature], course))
    along = np.linspace(0.5, 9.5, 200)
    true = course.warp(np.stack([along, np.full(200, 5.0)], axis=1))
    line = shapely.LineString(found.feature.points)
    assert 4 < len(found.feature.points) < 60
    assert shapely.distance(shapely.points(true), line).max() < 0.01


@pytest.mark.parametrize("grid", [None, OccupancyGrid(np.zeros((100, 100)), 0.1)])
def test_a_route_of_very_many_points_keeps_them_all(grid):
    turns = np.linspace(0.0, 20.0, 30_000)
    feature = route(*np.stack([5 + 3 * np.cos(turns), 5 + 3 * np.sin(turns)], axis=1))
    course = course_between(SCENE, SCENE, SAME, features=[feature])
    obstacles = None if grid is None else Obstacles.of_grid(grid, False)
    (found,) = finish(carried([feature], course, obstacles, 0.2))
    assert found.changes == ()
    assert found.feature.points == pytest.approx(feature.points, abs=1e-6)
    assert (found.sources[0] == np.arange(30_000)).all()


def test_a_route_through_a_wall_is_led_through_its_door():
    grid = floor(walls=[np.s_[:70, 48:52], np.s_[85:, 48:52]])
    found, _ = led(route((2, 2), (8, 2)), grid)
    # The table stands in the wall, and the door is above it.
    assert reasons(found) == [ChangeReason.OBSTACLE, ChangeReason.OTHER_SIDE]
    points = found.feature.points
    assert distance(found, grid) >= 0.2 - 1e-9
    assert points[[0, -1]] == pytest.approx(np.array([[2.0, 2.0], [8.0, 2.0]]), abs=1e-6)
    line = sampled(points, 0.05)
    through = line[np.abs(line[:, 0] - 5.0) < 0.3]
    assert len(through)
    assert ((through[:, 1] > 7.1) & (through[:, 1] < 8.5)).all()
    change = found.changes[0]
    assert points[change.first][0] < 4.8
    assert points[change.last][0] > 5.2


def test_a_route_there_and_back_has_the_changes_of_each_way():
    found, _ = led(route((3, 3), (7, 3), (3, 3)), floor(walls=[np.s_[28:32, 48:52]]))
    around = [each for each in found.changes if each.reason is ChangeReason.OBSTACLE]
    (sources,) = found.sources
    assert [sources[each.first] // 1 for each in around] == [0, 1]
    told = np.zeros(len(sources), dtype=bool)
    for each in around:
        told[each.first : each.last + 1] = True
    assert found.feature.points[~told][:, 1] == pytest.approx(3.0)


def test_a_door_that_is_too_narrow_is_none():
    grid = floor(walls=[np.s_[:70, 48:52], np.s_[73:, 48:52]])
    found, _ = led(route((2, 2), (8, 2)), grid, radius=0.3)
    assert reasons(found) == [ChangeReason.UNREACHABLE]
    assert found.feature.points[-1][0] < 4.8
    assert "can be reached" in found.changes[0].sentence


def test_a_route_through_a_thing_of_which_only_the_outline_was_seen_goes_on_behind_it():
    ring = [np.s_[30:32, 40:60], np.s_[48:50, 40:60], np.s_[30:50, 40:42], np.s_[30:50, 58:60]]
    grid = floor(walls=ring)
    found, _ = led(route((2, 3.8), (8, 3.8)), grid)
    assert reasons(found) == [ChangeReason.OBSTACLE]
    assert found.feature.points[-1] == pytest.approx([8.0, 3.8], abs=1e-6)
    assert distance(found, grid) >= 0.2 - 1e-9
    into, _ = led(route((2, 3.8), (5, 3.8)), grid)
    assert reasons(into) == [ChangeReason.UNREACHABLE]


def test_a_room_that_a_route_cannot_enter_is_said_to_be_left_out():
    grid = floor(walls=[np.s_[:, 50:52]])
    found, _ = led(route((2, 2), (8, 2), (8, 8), (2, 8)), grid)
    assert reasons(found)[0] is ChangeReason.OBSTACLE
    assert found.feature.points[-1] == pytest.approx([2.0, 8.0], abs=1e-6)
    assert found.changes[0].sentence.endswith("; what was drawn in between cannot be reached.")
    short, _ = led(route((2, 2), (8, 2)), floor(walls=[np.s_[15:25, 45:52]]))
    assert short.changes[0].sentence.endswith("away from obstacles.")


def test_a_clear_route_is_left_as_it_was_carried():
    found, _ = led(route((2, 2), (8, 2.5), (8, 8)), floor())
    assert found.changes == ()
    expected = np.array([[2, 2], [8, 2.5], [8, 8]])
    assert found.feature.points == pytest.approx(expected, abs=1e-6)


def test_ends_in_obstacles_are_moved_out_of_them():
    grid = floor(walls=[np.s_[15:25, 10:30], np.s_[75:85, 75:90]])
    found, _ = led(route((2, 2), (5, 2), (5, 8), (8, 8)), grid)
    assert reasons(found) == [ChangeReason.MOVED_START, ChangeReason.MOVED_END]
    assert distance(found, grid) >= 0.2 - 1e-9
    assert [change.first for change in found.changes] == [0, len(found.feature.points) - 1]


@pytest.mark.parametrize(("x", "share"), [(2.0, "All"), (4.95, "Nearly all")])
def test_of_a_route_that_lies_in_obstacles_nothing_is_left(x, share):
    walls = [np.s_[:, :45], np.s_[:, 54:]]  # at x = 4.95 one place between is clear
    found, _ = led(route((x, 2), (8, 2)), floor(walls=walls), radius=0.45)
    assert found.feature is None
    assert reasons(found) == [ChangeReason.UNREACHABLE]
    assert found.changes[0].sentence == f"{share} of it is blocked."


def test_unknown_cells_are_obstacles_unless_they_are_allowed():
    grid = floor(unknown=[np.s_[:70, 40:60]])
    around, _ = led(route((2, 5), (8, 5)), grid)
    straight, _ = led(route((2, 5), (8, 5)), grid, allow_unknown=True)
    assert reasons(around) == [ChangeReason.OBSTACLE]
    assert around.feature.points[:, 1].max() > 7.0
    assert straight.changes == ()


@pytest.mark.parametrize(("side", "above"), [(5.6, True), (4.4, False)])
def test_an_object_is_passed_on_the_side_on_which_it_was_drawn(side, above):
    """The table's obstacle reaches far up, or far down: the drawn side is the longer way."""
    reach = np.s_[40:80, 40:60] if above else np.s_[20:60, 40:60]
    feature = route((2, 5), (5, side), (8, 5))
    grid = floor(walls=[reach])
    found, _ = led(feature, grid)
    middle = found.feature.points[np.abs(found.feature.points[:, 0] - 5.0) < 1.0]
    assert distance(found, grid) >= 0.2 - 1e-9
    assert ((middle[:, 1] > 5.0) == above).all()
    assert reasons(found) == [ChangeReason.OBSTACLE]


def test_where_there_is_no_way_on_the_drawn_side_the_other_one_is_said():
    grid = floor(walls=[np.s_[40:, 40:60]])
    found, _ = led(route((2, 5), (5, 5.6), (8, 5)), grid)
    assert reasons(found) == [ChangeReason.OBSTACLE, ChangeReason.OTHER_SIDE]
    assert "table" in found.changes[1].sentence
    assert distance(found, grid) >= 0.2 - 1e-9


@settings(max_examples=12)
@example(1, 0.0625)  # through a corner of a cell whose middle is far enough away
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.3))
def test_no_route_comes_nearer_to_an_obstacle_than_its_radius(seed, radius):
    rng = np.random.default_rng(seed)
    cells = np.zeros((100, 100), dtype=np.int8)
    for _ in range(8):
        row, column = rng.integers(0, 90, 2)
        height, width = rng.integers(3, 20, 2)
        cells[row : row + height, column : column + width] = rng.choice([100, -1])
    grid = OccupancyGrid(cells, 0.1, (0.0, 0.0, 0.0))
    found, _ = led(route(*rng.uniform(0.5, 9.5, (4, 2))), grid, radius)
    if found.feature is None:
        return
    away = distance(found, grid)
    assert away >= radius - 0.1 * np.sqrt(0.5)
    assert away > 0.0
    order = found.sources[0]
    assert (np.diff(order) >= -1e-9).all()


@pytest.mark.parametrize(
    "points", [[(2, 2), (2, 2), (8, 2)], [(2, 2), (8, 8), (2, 2)], [(2, 2)] * 3]
)
def test_a_route_may_stand_still_and_come_back(points):
    grid = floor(walls=[np.s_[40:60, 40:60]])
    found, _ = led(route(*points), grid)
    assert distance(found, grid) >= 0.2 - 1e-9
    assert found.feature.points[[0, -1]] == pytest.approx(np.array(points)[[0, -1]], abs=1e-6)
    given_ = [k for k in found.sources[0] if k == int(k)]
    assert given_[0] == 0
    assert given_[-1] == 2


def test_a_grid_may_lie_turned_anywhere():
    angle = 0.5
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    grid = floor(walls=[np.s_[:70, 48:52]])
    there = OccupancyGrid(grid.cells, 0.1, (2.0, -3.0, angle))
    target = Scene.from_polygons([o.rings[0] @ turn + (2.0, -3.0) for o in SCENE.objects])
    feature = route((2, 2), (8, 2))
    course = course_between(SCENE, target, SAME, features=[feature])
    (found,) = finish(carried([feature], course, Obstacles.of_grid(there, False), 0.2))
    flat = (found.feature.points - (2.0, -3.0)) @ turn.T
    plain, _ = led(feature, grid)
    line, other = (shapely.LineString(each) for each in (flat, plain.feature.points))
    assert line.hausdorff_distance(other) < 0.15


def test_cells_and_places_are_each_others_inverse():
    obstacles = Obstacles.of_grid(OccupancyGrid(np.zeros((7, 5)), 0.25, (1.0, -2.0, 2.1)), False)
    cells = np.argwhere(np.ones((7, 5)))
    assert (obstacles.cells(obstacles.places(cells)) == cells).all()


def test_a_point_in_an_obstacle_stays_and_says_where_none_is():
    feature = Feature(FeatureKind.POINT, (np.array([[5.0, 5.0]]),))
    found, obstacles = led(feature, floor(walls=[np.s_[40:60, 40:60]]))
    assert found.feature.points == pytest.approx(np.array([[5.0, 5.0]]), abs=1e-6)
    assert reasons(found) == [ChangeReason.BLOCKED]
    x, y = found.changes[0].sentence.rpartition("(")[2].rstrip(").").split(",")
    assert obstacles.clear(np.array([[float(x), float(y)]]), 0.2).all()


@pytest.mark.parametrize("kind", ["point", "zone"])
def test_what_lies_beyond_the_grid_is_said(kind):
    ring = np.array(box(20, 20))[: 1 if kind == "point" else 4]
    found, _ = led(Feature(kind, (ring,)), floor())
    assert reasons(found) == [ChangeReason.OUTSIDE]
    assert found.feature is not None


@pytest.mark.parametrize(
    "corners", [(-40, -40, 40, 40), (-40, 4, 40, 6), (-3, -3, 5, 5)], ids=["all", "across", "part"]
)
def test_a_zone_lies_on_the_grid_wherever_its_corners_are(corners):
    x0, y0, x1, y1 = corners
    ring = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], dtype=float)
    found, _ = led(Feature(FeatureKind.ZONE, (ring,)), floor())
    assert found.changes == ()


def test_objects_of_a_scene_are_obstacles_too():
    feature = route((2, 5), (8, 5.1))
    course = course_between(SCENE, SCENE, SAME, features=[feature])
    obstacles = Obstacles.of_scene(SCENE, feature.points, 0.3)
    (found,) = finish(carried([feature], course, obstacles, 0.3, "units"))
    line = shapely.LineString(found.feature.points)
    assert SCENE.objects[4].polygon.distance(line) > 0.28
    assert found.changes[0].sentence == "Led around table, to stay 0.3 units away from obstacles."


@pytest.mark.parametrize(
    ("feature", "field"),
    [
        (("route", ([[0, 0]],)), "points"),
        (("point", ([[0, 0], [1, 1]],)), "points"),
        (("zone", ([[0, 0], [1, 1]],)), "rings[0]"),
        (("zone", ()), "rings"),
        (("path", ([[0, 0], [1, 1]],)), "kind"),
        (("route", ([0, 0], [1, 1])), "rings"),
        (("route", ([[0, 0], [1, np.inf]],)), "points"),
        (("route", ([0, 1],)), "points"),
        (("zone", ([[0, 0], [2, 2], [2, 0], [0, 2]],)), "rings"),
        (("route", ([[0, 0], [1, 1]],), "", [1.0]), "speeds"),
        (("route", ([[0, 0], [1, 1]],), "", [1.0, -1.0]), "speeds"),
        (("point", ([[0, 0]],), "", [1.0]), "speeds"),
    ],
)
def test_a_feature_that_is_none_is_refused_by_field(feature, field):
    kind, rings, *rest = feature
    with pytest.raises(InvalidInputError) as refused:
        Feature(kind, tuple(np.array(ring) for ring in rings), *rest)
    assert refused.value.field == field


def test_a_zone_without_area_is_told_so():
    with pytest.raises(InvalidInputError, match="enclose no area; draw a zone around what"):
        Feature("zone", ([[0, 0], [2, 0], [5, 0]],))


def test_a_zone_may_repeat_its_first_point():
    ring = np.array([*box(0, 0), (0, 0)])
    assert len(Feature("zone", (ring,)).points) == 4


def test_what_is_carried_beyond_all_bounds_is_refused_with_its_name():
    feature = Feature(FeatureKind.POINT, (np.array([[9e8, 0.0]]),), "far")
    with pytest.raises(InvalidInputError, match="a point 'far' that cannot be carried") as refused:
        finish(carried([feature], course_between(SCENE, TURNED, SAME, features=[feature])))
    assert refused.value.field == "features"


def test_points_that_are_carried_at_once_come_as_each_would_alone():
    rng = np.random.default_rng(0)
    grid = floor(walls=[np.s_[20:60, 30:50], np.s_[70:72, :]])
    features = [
        Feature(FeatureKind.POINT, (place[None, :],), f"p{k}")
        for k, place in enumerate(rng.uniform(-1.0, 11.0, (60, 2)))
    ]
    features.insert(7, route((1, 1), (8, 1), name="way"))
    course = course_between(SCENE, SCENE, SAME, features=features)
    obstacles = Obstacles.of_grid(grid, False)
    found = finish(carried(features, course, obstacles, 0.3, "m"))
    assert [each.name for each in found] == [each.name for each in features]
    for each, feature in zip(found, features, strict=True):
        (alone,) = finish(carried([feature], course, obstacles, 0.3, "m"))
        assert each.changes == alone.changes
        np.testing.assert_allclose(each.feature.points, alone.feature.points, rtol=1e-12)
        np.testing.assert_allclose(each.deviations[0], alone.deviations[0], rtol=1e-9)
    told = {reason for each in found for reason in reasons(each)}
    assert told == {ChangeReason.BLOCKED, ChangeReason.OUTSIDE}


@given(st.integers(0, 2**32), st.sampled_from([0.0, 0.15, 0.4]), st.floats(0.1, 6.0))
@examples(60)
def test_the_nearest_clear_place_is_the_nearest(seed, radius, within):
    rng = np.random.default_rng(seed)
    cells = (rng.random((60, 50)) < rng.choice([0.002, 0.02, 0.3])).astype(np.int8) * 100
    cells[10:40, 10:40] = 100
    obstacles = Obstacles.of_grid(OccupancyGrid(cells, 0.1), False)
    point = rng.uniform((0.0, 0.0), (5.0, 6.0))
    middles = np.argwhere(cells > -1)
    places = obstacles.places(middles)[obstacles.clear(obstacles.places(middles), radius)]
    away = np.hypot(*(places - point).T) if len(places) else np.array([np.inf])
    found = obstacles.nearest_clear(point, radius, within)
    if away.min() > within:
        assert found is None
    else:
        assert np.hypot(*(found - point)) == pytest.approx(away.min())
