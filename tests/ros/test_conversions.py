"""ROS messages become what the client sends, and its answers ROS messages."""

import math
from array import array

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st
from shapely.affinity import rotate, translate

from sketchmatch_client import InvalidRequestError, Match, MatchCollector, Progress, ServerBusyError
from sketchmatch_proto.v1 import match_pb2
from sketchmatch_proto.v1.source_pb2 import Y_AXIS_DOWN, Y_AXIS_UP
from sketchmatch_views import PAIR_COLOURS
from tests.contract.golden import golden
from tests.pace import within
from tests.ros.messages import message, read, wire

POINT = "geometry_msgs/msg/Point"


@pytest.fixture
def match() -> Match:
    collector = MatchCollector(None)
    for kind in ("accepted", "scenes", "progress", "result"):
        collector.add(golden(f"MatchResponse.{kind}"))
    return collector.match()


@pytest.fixture
def header(ros):
    del ros
    time = message("builtin_interfaces/msg/Time")(sec=3, nanosec=4)
    return message("std_msgs/msg/Header")(frame_id="map", stamp=time)


def grid(cells, *, resolution=0.5, at=(0.0, 0.0), yaw=0.0):
    """Return a map of rows, the lowest first."""
    rows = np.asarray(cells, dtype=np.int8)
    made = message("nav_msgs/msg/OccupancyGrid")(data=array("b", rows.tobytes()))
    made.header.frame_id = "map"
    made.info.resolution, made.info.height, made.info.width = resolution, *rows.shape
    made.info.origin.position.x, made.info.origin.position.y = at
    made.info.origin.orientation.z = math.sin(yaw / 2)
    made.info.origin.orientation.w = math.cos(yaw / 2)
    return made


def occupied(mask):
    rows = np.array(mask.data).reshape(mask.info.height, mask.info.width)
    assert set(np.unique(rows)) <= {0, 100}
    return {(int(row), int(column)) for row, column in np.argwhere(rows == 100)}


def test_a_map_is_sent_with_its_pose_and_cells(ros):
    sent = ros.conversions.map_source(
        grid([[0, 100, -1], [0, 0, 30]], at=(-1.5, 2.25), yaw=0.75)
    ).occupancy_grid
    assert (sent.rows, sent.columns, sent.resolution_meters) == (2, 3, 0.5)
    assert sent.cells == bytes([0, 100, 255, 0, 0, 30])
    assert (sent.origin.x_meters, sent.origin.y_meters) == (-1.5, 2.25)
    assert sent.origin.yaw_radians == pytest.approx(0.75)


def test_an_origin_that_nobody_set_is_not_turned(ros):
    plain = grid([[0, 100]])
    plain.info.origin.orientation.w = 0.0
    assert ros.conversions.map_source(plain).occupancy_grid.origin.yaw_radians == 0.0


def test_a_map_without_cells_is_refused(ros):
    with pytest.raises(InvalidRequestError, match="occupancy_grid"):
        ros.conversions.map_source(grid(np.zeros((0, 0))))


@pytest.mark.parametrize(
    ("given", "sent"), [("Y_AXIS_UP", Y_AXIS_UP), ("Y_AXIS_DOWN", Y_AXIS_DOWN)]
)
def test_a_sketch_is_sent_with_its_labels_and_its_way_of_y(ros, given, sent):
    point, stroke = message(POINT), message("sketchmatch_msgs/msg/Stroke")
    sketch = message("sketchmatch_msgs/msg/Sketch")
    drawn = sketch(
        strokes=[
            stroke(points=[point(x=1.5, y=2.0), point(x=3.0, y=-4.0, z=9.0)], label="sofa"),
            stroke(points=[point(x=5.0)]),
        ],
        y_axis=getattr(sketch, given),
    )
    strokes = ros.conversions.sketch_source(drawn).stroke_set
    assert strokes.y_axis == sent
    assert [stroke.label for stroke in strokes.strokes] == ["sofa", ""]
    points = [[(p.x, p.y) for p in stroke.points] for stroke in strokes.strokes]
    assert points == [[(1.5, 2.0), (3.0, -4.0)], [(5.0, 0.0)]]


def test_feedback_tells_how_far_it_is(ros):
    told = golden("MatchResponse.progress").progress
    found = read(
        wire(ros.conversions.feedback(Progress(told))), "sketchmatch_msgs/msg/MatchSketchFeedback"
    )
    assert (found.phase, found.confidence) == ("SEARCH", told.confidence)
    assert found.evaluations == told.evaluations
    assert found.elapsed == told.elapsed.ToTimedelta().total_seconds()


def test_feedback_before_the_search_has_no_confidence(ros):
    found = ros.conversions.feedback(Progress(match_pb2.MatchProgress(phase="PHASE_RELATE")))
    assert found.phase == "RELATE"
    assert math.isnan(found.confidence)


def test_an_object_map_is_in_the_maps_frame(ros, match, header):
    sent = wire(ros.conversions.object_map(match, header))
    found = read(sent, "sketchmatch_msgs/msg/ObjectMap")
    assert (found.header.frame_id, found.header.stamp.sec) == ("map", 3)
    assert (found.match_id, found.outcome) == (match.result.match_id, "ITERATION_LIMIT")
    assert (found.probability, found.place_probability) == (
        match.probability,
        match.place_probability,
    )
    lines = [
        (item.sketch_object, item.sketch_label, item.map_object, item.map_label)
        for item in found.objects
    ]
    assert lines == [(1, "desk", 3, "rack"), (2, "shelf", 0, "table")]
    first = found.objects[0]
    assert (first.center.x, first.center.y) == (15.0, 5.0)
    assert [(p.x, p.y) for p in first.outline] == [(10, 4), (20, 4), (20, 6), (10, 6)]
    line = match.result.object_matches[0]
    assert (first.confidence, first.probability) == (line.confidence, line.probability)
    groups = [(list(each.sketch_objects), list(each.map_objects)) for each in found.groups]
    assert groups == [([0, 1], [3]), ([2], [0, 1, 2])]
    assert found.groups[0].probability == 0.735
    assert math.isnan(found.groups[1].probability)
    assert list(found.unmatched_sketch_objects) == []
    match.result.ClearField("object_groups")
    alone = read(wire(ros.conversions.object_map(match, header)), "sketchmatch_msgs/msg/ObjectMap")
    assert list(alone.unmatched_sketch_objects) == [0]
    assert list(found.ask_about) == list(match.result.ambiguity.deciding_sketch_objects) != []
    scenes = match.scenes
    assert found.warnings == [*scenes.sketch_warnings, *scenes.map_warnings] != []


def test_what_is_unknown_is_nan(ros, match, header):
    for name in ("probability", "place_probability"):
        match.result.ClearField(name)
    match.result.object_matches[0].ClearField("probability")
    found = ros.conversions.object_map(match, header)
    unknown = (found.probability, found.place_probability, found.objects[0].probability)
    assert all(map(math.isnan, unknown))
    assert not math.isnan(found.objects[1].probability)


def test_markers_outline_and_name_each_object_in_its_colour(ros, match, header):
    shown = ros.conversions.markers(ros.conversions.object_map(match, header))
    found = read(wire(shown), "visualization_msgs/msg/MarkerArray").markers
    kinds = message("visualization_msgs/msg/Marker")
    assert [marker.action for marker in found] == [kinds.DELETEALL, *[kinds.ADD] * 4]
    _, outline, name, _, other = found
    assert (outline.type, name.type) == (kinds.LINE_STRIP, kinds.TEXT_VIEW_FACING)
    assert [(p.x, p.y) for p in outline.points] == [(10, 4), (20, 4), (20, 6), (10, 6), (10, 4)]
    assert (name.text, other.text) == ("desk", "shelf")
    assert (name.pose.position.x, name.pose.position.y) == (15.0, 5.0)
    for marker, colour in ((outline, PAIR_COLOURS[0]), (other, PAIR_COLOURS[1])):
        shades = (marker.color.r, marker.color.g, marker.color.b, marker.color.a)
        assert shades == pytest.approx([*(value / 255 for value in colour), 1.0])
    assert outline.pose.orientation.w == name.pose.orientation.w == 1.0
    assert outline.scale.x > 0
    assert name.scale.z > 0
    assert len({(marker.ns, marker.id) for marker in found[1:]}) == 4


def test_an_error_has_reason_field_and_pause(ros):
    refused = InvalidRequestError("map is empty", "INVALID_GRID", "map")
    result = ros.conversions.failure(refused, message("sketchmatch_msgs/msg/ObjectMap")())
    found = read(wire(result), "sketchmatch_msgs/msg/MatchSketchResult")
    assert (found.error, found.error_reason, found.error_field) == (
        "map is empty",
        "INVALID_GRID",
        "map",
    )
    assert found.retry_after == 0.0


def test_a_busy_server_says_when_to_come_back(ros):
    busy = ServerBusyError("the server is busy", "LIMIT_EXCEEDED")
    busy.retry_after = 2.0
    assert ros.conversions.failure(busy, None).retry_after == 2.0


@pytest.mark.parametrize(
    ("places", "expected"),
    [
        ([(0, 0), (2, 0), (2, 0), (2, 3)], [0, 0.5, 0.5, 0.5]),
        ([(0, 0), (0, 0), (0, 1), (-1, 1), (-1, 1)], [0.5, 0.5, 1, 1, 1]),
        ([(2, 2), (2, 2)], [0, 0]),
        ([(2, 2)], [0]),
        ([], []),
    ],
)
def test_a_route_looks_where_it_goes(ros, header, places, expected):
    path = ros.conversions.route_path(places, header)
    found = read(wire(path), "nav_msgs/msg/Path")
    assert {found.header.frame_id, *(pose.header.frame_id for pose in found.poses)} == {"map"}
    assert [(pose.pose.position.x, pose.pose.position.y) for pose in found.poses] == places
    headings = [
        2 * math.atan2(pose.pose.orientation.z, pose.pose.orientation.w) for pose in found.poses
    ]
    assert headings == pytest.approx([math.pi * each for each in expected])


def test_a_zone_is_occupied_in_a_mask_of_the_maps_own_cells(ros):
    room = grid(np.zeros((6, 8)), at=(10.0, 20.0))
    zone = [(11.0, 20.5), (12.9, 20.5), (12.9, 21.9), (11.0, 21.9)]
    mask = ros.conversions.keepout_mask([zone], room)
    assert mask.info == room.info
    assert mask.header == room.header
    assert occupied(mask) == {(row, column) for row in range(1, 4) for column in range(2, 6)}
    assert wire(mask)


def test_a_cell_that_a_zone_only_touches_is_kept_out_of(ros):
    sliver = [(0.1, 0.1), (1.9, 0.1), (1.9, 0.15), (0.1, 0.15)]
    mask = ros.conversions.keepout_mask([sliver], grid(np.zeros((3, 5))))
    assert occupied(mask) == {(0, 0), (0, 1), (0, 2), (0, 3)}


COORDINATES = st.one_of(st.integers(-6, 30).map(lambda k: k / 4), st.floats(-2.0, 7.0))


@given(
    corners=st.lists(st.tuples(COORDINATES, COORDINATES), min_size=3, max_size=6),
    yaw=st.sampled_from([0.0, 0.7, -2.0]),
)
def test_a_mask_forbids_each_cell_that_a_zone_reaches_into_and_no_other(ros, corners, yaw):
    zone = shapely.Polygon(corners)
    assume(zone.is_valid and zone.area > 0)
    at = (0.25, -0.5)
    mask = ros.conversions.keepout_mask([corners], grid(np.zeros((9, 12)), at=at, yaw=yaw))
    forbidden = occupied(mask)
    for row, column in np.ndindex(9, 12):
        x, y = column * 0.5, row * 0.5
        cell = translate(rotate(shapely.box(x, y, x + 0.5, y + 0.5), yaw, (0, 0), True), *at)
        if zone.intersection(cell).area > 1e-9:
            assert (row, column) in forbidden
        elif zone.distance(cell) > 1e-9:
            assert (row, column) not in forbidden


def test_a_zone_of_a_whole_country_is_soon_drawn(ros):
    zone = [(0.0, 0.0), (2e6, 0.0), (2e6, 1.0)]
    with within(2):
        mask = ros.conversions.keepout_mask([zone], grid(np.zeros((20, 30))))
    assert occupied(mask) == {(0, column) for column in range(30)}


def test_a_turned_map_has_its_zones_turned_back(ros):
    room = grid(np.zeros((4, 4)), at=(5.0, 5.0), yaw=math.pi / 2)
    # Columns run along y and rows against x.
    zone = [(4.55, 6.05), (4.95, 6.05), (4.95, 6.95), (4.55, 6.95)]
    mask = ros.conversions.keepout_mask([zone], room)
    assert occupied(mask) == {(0, 2), (0, 3)}


@pytest.mark.parametrize("yaw", [0.0, 0.1, 0.7, -2.0])
def test_a_zone_along_cells_of_a_turned_map_takes_none_beside_them(ros, yaw):
    cells = np.array([(0.5, 1.0), (2.0, 1.0), (2.0, 2.5), (0.5, 2.5)])
    c, s = math.cos(yaw), math.sin(yaw)
    zone = (cells @ [[c, s], [-s, c]] + (-7.3, 4.1)).tolist()
    mask = ros.conversions.keepout_mask([zone], grid(np.zeros((9, 12)), at=(-7.3, 4.1), yaw=yaw))
    assert occupied(mask) == {(row, column) for row in range(2, 5) for column in range(1, 4)}


def test_zones_beyond_the_map_are_cut_and_several_are_joined(ros):
    zones = [[(-9, -9), (0.4, -9), (0.4, 0.4), (-9, 0.4)], [(1.6, 1.1), (99, 1.1), (99, 99)]]
    mask = ros.conversions.keepout_mask(zones, grid(np.zeros((3, 5))))
    assert (0, 0) in occupied(mask)
    assert (2, 4) in occupied(mask)
    assert (1, 1) not in occupied(mask)
    for nothing in ([], [[]]):
        assert occupied(ros.conversions.keepout_mask(nothing, grid(np.zeros((3, 5))))) == set()


def test_what_is_to_be_carried_lies_as_the_objects_of_its_sketch(ros, match):
    point, stroke = message(POINT), message("sketchmatch_msgs/msg/Stroke")
    sketch = message("sketchmatch_msgs/msg/Sketch")
    zones = [stroke(points=[point(x=1.0, y=2.0), point(x=3.0, y=4.0)])]
    drawn = ros.conversions.drawn_features(sketch(zones=zones, y_axis=sketch.Y_AXIS_DOWN), match)
    assert drawn.zones == [[(1.0, -2.0), (3.0, -4.0)]]
    assert drawn.routes == [[(p.x, p.y) for p in match.scenes.sketch_route]]
    assert len(drawn.routes[0]) > 1
    match.scenes.ClearField("sketch_route")
    drawn = ros.conversions.drawn_features(sketch(zones=zones, y_axis=sketch.Y_AXIS_UP), match)
    assert (drawn.routes, drawn.zones) == ([], [[(1.0, 2.0), (3.0, 4.0)]])


def test_the_service_answers_in_the_order_of_what_was_drawn(ros, header):
    carried = ros.conversions.carried(
        ros.matching.Features([[(0, 0), (1, 0)], []], [[], [(0, 0), (2, 0), (2, 2)]]), header
    )
    found = read(wire(carried), "sketchmatch_msgs/msg/CarryResponse")
    assert [len(path.poses) for path in found.routes] == [2, 0]
    assert [[(p.x, p.y) for p in zone.points] for zone in found.zones] == [
        [],
        [(0, 0), (2, 0), (2, 2)],
    ]
    assert found.routes[0].header.frame_id == "map"


def test_nav2_is_told_of_the_mask(ros, header):
    told = ros.conversions.filter_info("/sketchmatch/keepout_mask", header)
    found = read(wire(told), "nav2_msgs/msg/CostmapFilterInfo")
    assert (found.type, found.filter_mask_topic) == (0, "/sketchmatch/keepout_mask")
    assert (found.base, found.multiplier) == (0.0, 1.0)
