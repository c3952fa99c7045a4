"""The node, between stand-ins for ROS, matches the README's goal on a real server."""

from array import array

import numpy as np
import pytest
import yaml

from sketchmatch_client import Client
from tests import processes
from tests.pages import Page
from tests.ros.messages import message
from tests.ros.rclpy_stand_in import GoalHandle, GoalResponse

pytestmark = pytest.mark.slow

GOAL = Page("clients/ros/README.md", __name__).take_one("yaml", "strokes:")
BOXES = {"table": (7, 7, 2, 3), "bunk": (1, 9, 4, 2), "rack": (2, 1, 1, 5)}
CELL = 0.05


def room():
    """Return a map of the three objects, upright, in a room of 12 by 12 metres."""
    cells = np.zeros((240, 240), dtype=np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    for x, y, width, height in BOXES.values():
        cells[y * 20 : (y + height) * 20, x * 20 : (x + width) * 20] = 100
    made = message("nav_msgs/msg/OccupancyGrid")(data=array("b", cells.tobytes()))
    made.header.frame_id = "map"
    made.info.resolution, made.info.height, made.info.width = CELL, *cells.shape
    return made


def drawn():
    """Return the goal that the README shows, read as ``ros2 action send_goal`` reads it."""
    given = yaml.safe_load(GOAL.text)
    point, stroke = message("geometry_msgs/msg/Point"), message("sketchmatch_msgs/msg/Stroke")
    strokes = [
        stroke(
            points=[point(**{k: float(v) for k, v in place.items()}) for place in each["points"]],
            label=each["label"],
        )
        for each in given["sketch"]["strokes"]
    ]
    sketch = message("sketchmatch_msgs/msg/Sketch")(
        strokes=strokes, y_axis=given["sketch"]["y_axis"]
    )
    goal = message("sketchmatch_msgs/msg/MatchSketchGoal")
    return goal(sketch=sketch, time_budget=given["time_budget"])


def test_a_drawn_route_and_a_zone_are_carried_where_they_were_drawn(ros):
    with processes.server() as running:
        node = ros.node.SketchmatchNode(ros.carrying.carry)
        node.parameters |= {"address": running.address, "radius": 0.2}
        node.go("configure", "inactive")
        node.go("activate", "active")
        node.subscriptions["map"].callback(room())
        goal = drawn()
        point, stroke = message("geometry_msgs/msg/Point"), message("sketchmatch_msgs/msg/Stroke")
        way = [point(x=x, y=y) for x, y in [(6.0, 1.0), (6.0, 4.0), (5.0, 8.0)]]
        goal.sketch.strokes.append(stroke(points=way, label="route"))
        corners = [(7.0, 8.0), (9.0, 8.0), (9.0, 10.0), (7.0, 10.0), (7.1, 7.9)]  # past the start
        area = [point(x=x, y=y) for x, y in corners]
        goal.sketch.zones = [stroke(points=area)]
        handle = GoalHandle(node.action_server, goal)
        result = node.action_server.execute(handle)
        assert (handle.status, result.error) == ("succeeded", "")
        # A sketch of one unit a metre, upside down: (x, y) lies at (x, 12 - y).
        (route,) = node.publishers["/sketchmatch/route"].sent
        first, last = route.poses[0].pose.position, route.poses[-1].pose.position
        assert (first.x, first.y, last.x, last.y) == pytest.approx((6, 11, 5, 4), abs=0.2)
        (mask,) = node.publishers["/sketchmatch/keepout_mask"].sent
        rows, columns = np.nonzero(np.array(mask.data).reshape(240, 240))
        edges = [columns.min(), columns.max(), rows.min(), rows.max()]
        assert np.array(edges) * CELL == pytest.approx((7, 9, 2, 4), abs=0.2)
        with Client(running.address) as client:
            assert len(client.list_scenes()) == 1
            node.go("shutdown", "finalized")
            assert client.list_scenes() == []


def test_the_goal_of_the_readme_has_its_objects_where_they_are(ros):
    with processes.server() as running:
        node = ros.node.SketchmatchNode()
        node.parameters["address"] = running.address
        node.go("configure", "inactive")
        node.go("activate", "active")
        node.subscriptions["map"].callback(room())
        goal = drawn()
        assert node.action_server.accepts(goal) is GoalResponse.ACCEPT
        handle = GoalHandle(node.action_server, goal)
        result = node.action_server.execute(handle)
        assert (handle.status, result.error) == ("succeeded", "")
        found = {item.sketch_label: item.center for item in result.object_map.objects}
        for label, name in (("bed", "bunk"), ("desk", "table"), ("shelf", "rack")):
            x, y, width, height = BOXES[name]
            centre = (found[label].x, found[label].y)
            assert centre == pytest.approx((x + width / 2, y + height / 2), abs=2 * CELL)
        node.go("shutdown", "finalized")
