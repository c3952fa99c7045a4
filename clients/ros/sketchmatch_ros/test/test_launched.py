"""The launched node beside a real server, as somebody who draws meets it: by ROS alone.

``colcon test --packages-select sketchmatch_ros`` runs this where ROS is. The environment's
``SKETCHMATCH`` is the server's program, ``sketchmatch`` where it is not set.
"""

import os
import signal
import socket
import subprocess
import time
from array import array
from functools import partial

import pytest
import rclpy
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Point
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from nav2_msgs.msg import CostmapFilterInfo
from nav_msgs.msg import OccupancyGrid, Path
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from sketchmatch_msgs.action import MatchSketch
from sketchmatch_msgs.msg import ObjectMap, Sketch, Stroke
from sketchmatch_msgs.srv import Carry
from visualization_msgs.msg import MarkerArray

# The first start compiles the server's numerical kernels.
PATIENCE = 180.0
CELL = 0.05
SIDE = 260
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TOPICS = {
    "object_map": ObjectMap,
    "markers": MarkerArray,
    "route": Path,
    "keepout_mask": OccupancyGrid,
    "keepout_filter_info": CostmapFilterInfo,
}
# Of a room of 13 m, y up: left, bottom, width and height, in metres.
BOXES = {"table": (7.0, 7.0, 2.0, 3.0), "bunk": (1.0, 9.0, 4.0, 2.0), "rack": (2.0, 1.0, 1.0, 5.0)}
CROWD = {str(k): (1.0 + 1.7 * (k % 7), 1.0 + 1.7 * (k // 7), 0.6, 0.6) for k in range(49)}


@pytest.fixture(scope="module")
def launched(tmp_path_factory):
    """Start a server, and launch the node beside it."""
    folder = tmp_path_factory.mktemp("launched")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        address = f"127.0.0.1:{taken.getsockname()[1]}"
    program = os.environ.get("SKETCHMATCH", "sketchmatch")
    parameters = folder / "parameters.yaml"
    parameters.write_text(
        f"sketchmatch:\n  ros__parameters:\n    address: {address}\n    radius: 0.2\n"
    )
    launch = ["ros2", "launch", "sketchmatch_ros", "sketchmatch.launch.py"]
    server = subprocess.Popen([program, "serve", "--address", address])
    said = folder / "said.txt"
    try:
        end = time.monotonic() + PATIENCE
        while subprocess.run([program, "health", address], check=False).returncode:
            assert time.monotonic() < end, f"the server is not ready within {PATIENCE:g} s"
            time.sleep(0.5)
        with said.open("wb") as log:
            node = subprocess.Popen(
                [*launch, f"params_file:={parameters}"],
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        try:
            yield said
        finally:
            os.killpg(node.pid, signal.SIGINT)
            node.wait(30.0)
    finally:
        server.terminate()
        server.wait(30.0)


@pytest.fixture(scope="module")
def person(launched):
    """Give a node that knows the launched one by its topics, services and action."""
    rclpy.init()
    node = rclpy.create_node("person")
    try:
        yield Person(node, launched.read_text)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    assert "Traceback" not in launched.read_text()


class Person:
    """Somebody who draws, shows maps, and hears what is published."""

    def __init__(self, node, log):
        self.node, self.log, self.heard = node, log, {}
        self.maps = node.create_publisher(OccupancyGrid, "map", LATCHED)
        for topic, kind in TOPICS.items():
            hear = partial(self.heard.__setitem__, topic)
            node.create_subscription(kind, f"/sketchmatch/{topic}", hear, LATCHED)
        self.action = ActionClient(node, MatchSketch, "/sketchmatch/match_sketch")
        self.services = {
            name: node.create_client(kind, f"/sketchmatch/{name}")
            for name, kind in (("carry", Carry), ("get_state", GetState))
        }
        self.services["change_state"] = node.create_client(ChangeState, "/sketchmatch/change_state")

    def told(self, future):
        rclpy.spin_until_future_complete(self.node, future, timeout_sec=PATIENCE)
        assert future.done(), f"there is no answer within {PATIENCE:g} s"
        return future.result()

    def until(self, condition):
        end = time.monotonic() + PATIENCE
        while not (found := condition()):
            assert time.monotonic() < end, f"it is not so within {PATIENCE:g} s"
            rclpy.spin_once(self.node, timeout_sec=0.1)
        return found

    def call(self, name, request):
        assert self.services[name].wait_for_service(timeout_sec=PATIENCE)
        return self.told(self.services[name].call_async(request))

    def state(self):
        return self.call("get_state", GetState.Request()).current_state.id

    def change(self, transition):
        request = ChangeState.Request()
        request.transition.id = transition
        return self.call("change_state", request).success

    def send(self, goal, feedback=None):
        assert self.action.wait_for_server(timeout_sec=PATIENCE)
        return self.told(self.action.send_goal_async(goal, feedback_callback=feedback))

    def show(self, boxes, frame):
        """Publish a map, and wait until the launched node has it."""
        self.maps.publish(room(boxes, frame))
        self.until(lambda: f"cells in {frame}" in self.log())


def room(boxes, frame):
    """Return a map of boxes within four walls."""
    cells = bytearray(SIDE * SIDE)
    for row in range(SIDE):
        for column in range(SIDE):
            x, y = (column + 0.5) * CELL, (row + 0.5) * CELL
            wall = row in (0, SIDE - 1) or column in (0, SIDE - 1)
            if wall or any(0 < x - a < w and 0 < y - b < h for a, b, w, h in boxes.values()):
                cells[row * SIDE + column] = 100
    made = OccupancyGrid(data=array("b", cells))
    made.header.frame_id = frame
    made.info.resolution, made.info.width, made.info.height = CELL, SIDE, SIDE
    return made


def stroke(points, label=""):
    return Stroke(points=[Point(x=float(x), y=float(y)) for x, y in points], label=label)


def ring(x, y, width, height):
    return [(x, y), (x + width, y), (x + width, y + height), (x, y + height), (x, y + 0.05)]


def drawn(boxes, **options):
    """Return a goal with the boxes as they are, drawn by somebody who names them."""
    strokes = [stroke(ring(*box), name) for name, box in boxes.items()]
    return MatchSketch.Goal(sketch=Sketch(strokes=strokes, y_axis=Sketch.Y_AXIS_UP), **options)


def test_the_launch_file_makes_the_node_active(person):
    person.until(lambda: person.state() == State.PRIMARY_STATE_ACTIVE)


def test_a_goal_before_the_first_map_is_refused(person):
    assert not person.send(drawn(BOXES)).accepted


def test_a_goal_succeeds_with_feedback_and_everything_is_published(person):
    person.show(BOXES, "hall")
    goal = drawn(BOXES, time_budget=20.0)
    goal.sketch.strokes.append(stroke([(6.0, 11.0), (6.0, 8.0), (5.0, 4.0)], "route"))
    goal.sketch.zones.append(stroke([(7.0, 2.0), (9.0, 2.0), (9.0, 4.0), (7.0, 4.0)]))
    phases = []
    handle = person.send(goal, lambda message: phases.append(message.feedback.phase))
    answer = person.told(handle.get_result_async())
    assert (answer.status, answer.result.error) == (GoalStatus.STATUS_SUCCEEDED, "")
    found = {item.sketch_label: item.center for item in answer.result.object_map.objects}
    assert found.keys() == BOXES.keys()
    for name, (x, y, width, height) in BOXES.items():
        centre = (found[name].x, found[name].y)
        assert centre == pytest.approx((x + width / 2, y + height / 2), abs=2 * CELL)
    assert phases
    assert all(phases)

    heard = person.heard
    person.until(lambda: heard.keys() == TOPICS.keys())
    assert heard["object_map"].header.frame_id == "hall"
    assert {marker.ns for marker in heard["markers"].markers}
    poses = [pose.pose.position for pose in heard["route"].poses]
    ends = (poses[0].x, poses[0].y, poses[-1].x, poses[-1].y)
    assert ends == pytest.approx((6.0, 11.0, 5.0, 4.0), abs=0.3)
    mask = heard["keepout_mask"]
    closed = [divmod(k, SIDE) for k, value in enumerate(mask.data) if value == 100]
    columns, rows = [column for _, column in closed], [row for row, _ in closed]
    edges = [CELL * edge for edge in (min(columns), max(columns), min(rows), max(rows))]
    assert edges == pytest.approx((7.0, 9.0, 2.0, 4.0), abs=0.3)
    assert heard["keepout_filter_info"].filter_mask_topic == "/sketchmatch/keepout_mask"


def test_more_of_the_sketch_is_carried_by_the_service(person):
    way = stroke([(10.0, 1.0), (10.0, 11.0)])
    carried = person.call("carry", Carry.Request(routes=[way], y_axis=Sketch.Y_AXIS_UP))
    assert carried.error == ""
    (route,) = carried.routes
    first, last = route.poses[0].pose.position, route.poses[-1].pose.position
    assert (first.x, first.y, last.x, last.y) == pytest.approx((10, 1, 10, 11), abs=0.3)


def test_a_goal_that_is_cancelled_ends_soon(person):
    person.show(CROWD, "crowd")
    feedback = []
    goal = drawn(CROWD, time_budget=600.0, profile="thesis-easm")
    handle = person.send(goal, feedback.append)
    person.until(lambda: any(message.feedback.phase == "SEARCH" for message in feedback))
    began = time.monotonic()
    cancelled = person.told(handle.cancel_goal_async())
    assert len(cancelled.goals_canceling) == 1
    answer = person.told(handle.get_result_async())
    assert answer.status == GoalStatus.STATUS_CANCELED
    assert time.monotonic() - began < 30.0


def test_a_goal_that_the_server_refuses_is_aborted_with_its_reason(person):
    handle = person.send(drawn(BOXES, profile="none-such"))
    answer = person.told(handle.get_result_async())
    assert answer.status == GoalStatus.STATUS_ABORTED
    assert answer.result.error_reason == "UNKNOWN_PROFILE"
    assert "none-such" in answer.result.error


def test_the_node_goes_through_its_life_and_takes_goals_again(person):
    assert person.change(Transition.TRANSITION_DEACTIVATE)
    assert not person.send(drawn(BOXES)).accepted
    assert person.change(Transition.TRANSITION_CLEANUP)
    assert person.state() == State.PRIMARY_STATE_UNCONFIGURED
    assert person.change(Transition.TRANSITION_CONFIGURE)
    assert person.change(Transition.TRANSITION_ACTIVATE)
    person.show(BOXES, "again")
    answer = person.told(person.send(drawn(BOXES)).get_result_async())
    assert answer.status == GoalStatus.STATUS_SUCCEEDED
