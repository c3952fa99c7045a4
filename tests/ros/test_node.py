"""The node between stand-ins for rclpy and a server: its life, its goals, and what it publishes."""

import time
from array import array
from copy import deepcopy
from itertools import groupby
from threading import Thread, get_ident

import grpc
import numpy as np
import pytest

from sketchmatch_client import InvalidRequestError, NotFoundError, sources
from sketchmatch_proto.v1 import scene_service_pb2, transfer_service_pb2
from tests.client.fake_server import EVENTS, reason, running, violation
from tests.contract.golden import golden
from tests.pace import wait_until
from tests.ros.messages import message, wire
from tests.ros.rclpy_stand_in import (
    GoalHandle,
    GoalResponse,
    Policy,
    TransitionCallbackReturn,
)

STREAM = tuple(
    golden(f"MatchResponse.{kind}") for kind in ("accepted", "scenes", "progress", "result")
)


@pytest.fixture
def server():
    with running() as fake:
        fake.events = STREAM
        yield fake


@pytest.fixture
def node(ros, server):
    """An active node with a map."""
    made = ros.node.SketchmatchNode()
    made.parameters |= {"address": server.address, "profile": "careful"}
    assert made.go("configure", "inactive") is TransitionCallbackReturn.SUCCESS
    made.go("activate", "active")
    made.subscriptions["map"].callback(room())
    yield made
    made.go("deactivate", "inactive")
    made.go("cleanup", "unconfigured")


def room(rows=2, columns=3):
    made = message("nav_msgs/msg/OccupancyGrid")(data=array("b", bytes(rows * columns)))
    made.header.frame_id = "site"
    made.info.resolution, made.info.height, made.info.width = 0.05, rows, columns
    return made


def goal(**options):
    point = message("geometry_msgs/msg/Point")
    stroke = message("sketchmatch_msgs/msg/Stroke")(
        points=[point(x=1.0), point(y=2.0)], label="bed"
    )
    sketch = message("sketchmatch_msgs/msg/Sketch")(strokes=[stroke], y_axis=1)
    return message("sketchmatch_msgs/msg/MatchSketchGoal")(sketch=sketch, **options)


def executed(node, **options):
    """Send a goal as a client does, and return it with what came of it."""
    server = node.action_server
    wanted = goal(**options)
    assert server.accepts(wanted) is GoalResponse.ACCEPT
    handle = GoalHandle(server, wanted)
    return handle, server.execute(handle)


def sent(node, topic):
    return node.publishers[f"/sketchmatch/{topic}"].sent


def test_a_goal_is_matched_with_the_latest_map_and_succeeds(node, server):
    handle, result = executed(node, seed=9, time_budget=2.5)
    (request,) = server.requests
    assert request.map == sources.occupancy_grid(bytes(6), 0.05, columns=3)
    assert request.sketch.stroke_set.strokes[0].label == "bed"
    assert (request.seed, request.time_budget.ToTimedelta().total_seconds()) == (9, 2.5)
    assert request.pipeline.profile == "careful"
    assert handle.status == "succeeded"
    assert [item.map_object for item in result.object_map.objects] == [3, 0]
    assert [told.phase for told in handle.feedback] == ["SEARCH"]
    assert wire(result)


def test_the_answer_is_published_for_all_and_for_rviz(node):
    _, result = executed(node)
    (answer,), (markers,) = sent(node, "object_map"), sent(node, "markers")
    assert answer == result.object_map
    assert (answer.header.frame_id, answer.header.stamp.sec) == ("site", 7)
    assert len(markers.markers) == 5
    assert set(node.publishers) == {"/sketchmatch/object_map", "/sketchmatch/markers"}


def test_maps_and_answers_are_latched(node):
    profiles = [publisher.qos for publisher in node.publishers.values()]
    profiles.append(node.subscriptions["map"].qos)
    for qos in profiles:
        assert (qos.depth, qos.durability) == (1, Policy.TRANSIENT_LOCAL)
        assert qos.reliability is Policy.RELIABLE


def test_what_a_goal_leaves_open_the_parameters_say(node, server):
    executed(node)
    executed(node, profile="proof")
    first, second = server.requests
    assert first.time_budget.ToTimedelta().total_seconds() == 5.0
    assert (first.pipeline.profile, second.pipeline.profile) == ("careful", "proof")
    node.parameters["time_budget"] = 0.0
    executed(node)
    assert not server.requests[-1].HasField("time_budget")


def test_a_later_map_takes_the_place_of_one_before_unless_it_cannot_be_used(node, server):
    node.subscriptions["map"].callback(room(4, 5))
    broken = room()
    broken.info.width = 4
    node.subscriptions["map"].callback(broken)
    executed(node)
    assert server.requests[0].map.occupancy_grid.columns == 5
    level, text = node.said[-1]
    assert level == "error"
    assert "occupancy_grid.columns" in text


def test_a_refused_request_aborts_with_reason_and_field(node, server):
    server.fail(
        grpc.StatusCode.INVALID_ARGUMENT,
        "draw more",
        reason("TOO_FEW_OBJECTS"),
        violation("sketch"),
    )
    handle, result = executed(node)
    assert handle.status == "aborted"
    assert (result.error, result.error_reason, result.error_field) == (
        "draw more",
        "TOO_FEW_OBJECTS",
        "sketch",
    )
    assert sent(node, "object_map") == []


def test_a_cancelled_goal_is_cancelled_on_the_server(node, server):
    server.events, server.endless = EVENTS[:3], True
    handle = GoalHandle(node.action_server, goal())
    results = []
    worker = Thread(target=lambda: results.append(node.action_server.execute(handle)))
    worker.start()
    wait_until(lambda: handle.feedback, "no feedback comes")
    handle.cancel()
    worker.join(20)
    assert handle.status == "canceled"
    assert server.cancelled.wait(5)
    assert "cancelled" in results[0].error


def test_a_deactivated_node_aborts_its_goals_and_takes_none(node, server):
    server.events, server.endless = EVENTS[:3], True
    handle = GoalHandle(node.action_server, goal())
    worker = Thread(target=lambda: node.action_server.execute(handle))
    worker.start()
    wait_until(lambda: handle.feedback, "no feedback comes")
    node.go("deactivate", "inactive")
    worker.join(20)
    assert handle.status == "aborted"
    assert server.cancelled.wait(5)
    assert node.action_server.accepts(goal()) is GoalResponse.REJECT
    assert "activate it" in node.said[-1][1]


def test_a_goal_without_strokes_and_one_before_the_map_are_refused(ros, server, node):
    empty = goal()
    empty.sketch.strokes = []
    assert node.action_server.accepts(empty) is GoalResponse.REJECT
    assert "draw two objects" in node.said[-1][1]
    early = ros.node.SketchmatchNode()
    early.parameters["address"] = server.address
    early.go("configure", "inactive")
    early.go("activate", "active")
    assert early.action_server.accepts(goal()) is GoalResponse.REJECT
    assert "no map has arrived on map yet" in early.said[-1][1]
    early.go("shutdown", "finalized")
    assert early.action_server.destroyed


def test_what_cannot_be_configured_says_why_and_can_be_tried_again(ros, server, tmp_path):
    made = ros.node.SketchmatchNode()
    made.parameters |= {"address": server.address, "token_file": str(tmp_path / "missing")}
    assert made.go("configure", "inactive") is TransitionCallbackReturn.FAILURE
    assert "missing" in made.said[-1][1]
    made.parameters["token_file"] = ""
    assert made.go("configure", "inactive") is TransitionCallbackReturn.SUCCESS
    made.go("cleanup", "unconfigured")
    assert (made.publishers, made.subscriptions) == ({}, {})
    assert made.go("configure", "inactive") is TransitionCallbackReturn.SUCCESS
    made.go("shutdown", "finalized")


def test_a_node_that_was_never_configured_can_be_shut_down(ros):
    assert (
        ros.node.SketchmatchNode().go("shutdown", "finalized") is TransitionCallbackReturn.SUCCESS
    )


def put(name, **fields):
    stored = scene_service_pb2.StoredScene(name=name, **fields)
    return scene_service_pb2.PutSceneResponse(stored_scene=stored, created=True)


def asked(server):
    """Return what a server was asked since the last look: each method, and which scene."""
    told = []
    for request in server.requests:
        kind = type(request).__name__.removesuffix("Request")
        source = getattr(request, "map", None) or getattr(request, "source", None)
        told.append((kind, (source and source.stored_scene) or getattr(request, "name", "")))
    server.requests.clear()
    return told


def test_the_server_keeps_the_map_so_that_goals_need_not_bring_it(node, server):
    server.kept = put("first")
    executed(node)
    first = server.requests[0]
    assert first.source == sources.occupancy_grid(bytes(6), 0.05, columns=3)
    assert first.profile == "careful"
    executed(node)
    assert asked(server) == [("PutScene", ""), ("Match", "first"), ("Match", "first")]
    node.subscriptions["map"].callback(room(4, 5))
    server.kept = put("second")
    executed(node)
    assert asked(server) == [("PutScene", ""), ("DeleteScene", "first"), ("Match", "second")]
    # Another pipeline finds other objects, here the same ones.
    executed(node, profile="proof")
    assert asked(server) == [("PutScene", ""), ("Match", "second")]
    node.go("deactivate", "inactive")
    node.go("cleanup", "unconfigured")
    assert asked(server) == [("DeleteScene", "second")]
    node.go("configure", "inactive")


def test_what_others_have_the_server_keep_stays(node, server):
    server.kept = put("theirs")
    server.kept.created = False
    executed(node)
    node.subscriptions["map"].callback(room(4, 5))
    server.kept = put("ours")
    executed(node)
    assert asked(server) == [
        ("PutScene", ""),
        ("Match", "theirs"),
        ("PutScene", ""),
        ("Match", "ours"),
    ]


def test_a_map_of_rooms_is_sent_itself_since_they_are_cut_to_fit_the_sketch(node, server):
    server.kept = put("rooms", passages=[scene_service_pb2.Passage(first=0, second=1)])
    executed(node)
    executed(node)
    assert asked(server) == [("PutScene", ""), ("Match", ""), ("Match", "")]
    node.subscriptions["map"].callback(room(4, 5))
    server.kept = put("things")
    executed(node)
    assert asked(server) == [("PutScene", ""), ("DeleteScene", "rooms"), ("Match", "things")]


def test_a_map_that_the_server_has_lost_is_sent_again(node, server):
    server.kept = put("lost")
    executed(node)
    assert asked(server)[1:] == [("Match", "lost")]
    server.fail(grpc.StatusCode.NOT_FOUND, "no scene is called lost")
    server.fails = 1
    handle, _ = executed(node)
    assert handle.status == "succeeded"
    assert asked(server) == [("Match", "lost"), ("Match", "")]
    server.error = None
    executed(node)
    assert asked(server) == [("PutScene", ""), ("Match", "lost")]


class Carrier:
    """Carries a hundredth of everything; fails where it is told to."""

    def __init__(self, features):
        self.features, self.asked, self.error, self.notes = features, [], None, []

    def __call__(self, client, sketch, map_, partners, drawn, radius):
        assert radius == 0.0
        assert client.server_info().api_version == "sketchmatch.v1"
        self.asked.append((sketch, map_, partners, drawn))
        if self.error is not None:
            raise self.error
        return self.features(
            *(
                [[(x / 100, y / 100) for x, y in line] for line in lines]
                for lines in (drawn.routes, drawn.zones)
            ),
            self.notes,
        )


@pytest.fixture
def carrier(ros):
    return Carrier(ros.matching.Features)


@pytest.fixture
def carrying(ros, server, carrier):
    """An active node with a map and a carrier."""
    made = ros.node.SketchmatchNode(carrier)
    made.parameters["address"] = server.address
    made.go("configure", "inactive")
    made.go("activate", "active")
    made.subscriptions["map"].callback(room())
    yield made
    made.go("deactivate", "inactive")
    made.go("cleanup", "unconfigured")
    assert made.services == {}


def with_zone(wanted):
    point = message("geometry_msgs/msg/Point")
    corners = [point(x=x, y=y) for x, y in [(0.0, 0.0), (4.0, 0.0), (4.0, -4.0), (0.0, -4.0)]]
    wanted.sketch.zones = [message("sketchmatch_msgs/msg/Stroke")(points=corners)]
    return wanted


def test_what_a_carrier_carries_is_published_for_nav2(carrying, carrier, server):
    handle = GoalHandle(carrying.action_server, with_zone(goal()))
    assert carrying.action_server.accepts(handle.request) is GoalResponse.ACCEPT
    carrying.action_server.execute(handle)
    ((sketch, map_, partners, drawn),) = carrier.asked
    assert (sketch, map_) == (server.requests[0].sketch, server.requests[0].map)
    assert partners == {1: 3, 2: 0}
    assert drawn.zones == [[(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)]]
    (route,), (mask,) = sent(carrying, "route"), sent(carrying, "keepout_mask")
    assert route.header.frame_id == "site"
    assert len(route.poses) == len(STREAM[1].scenes.sketch_route) > 1
    assert list(np.array(mask.data)) == [100, 0, 0, 0, 0, 0]
    (told,) = sent(carrying, "keepout_filter_info")
    assert told.filter_mask_topic == "/sketchmatch/keepout_mask"


def test_a_sketch_without_route_and_zones_takes_away_those_of_an_earlier_one(
    carrying, carrier, server
):
    executed(carrying)
    scenes = deepcopy(STREAM[1])
    scenes.scenes.ClearField("sketch_route")
    server.events = (STREAM[0], scenes, *STREAM[2:])
    executed(carrying)
    assert len(carrier.asked) == 1
    assert [bool(path.poses) for path in sent(carrying, "route")] == [True, False]
    assert not any(sent(carrying, "keepout_mask")[-1].data)


def test_what_cannot_be_carried_aborts_and_keeps_the_object_map(carrying, carrier):
    carrier.error = InvalidRequestError("the objects are mirrored", "INVALID_FIELD", "object_map")
    handle, result = executed(carrying)
    assert handle.status == "aborted"
    assert (result.error, result.error_field) == ("the objects are mirrored", "object_map")
    assert len(result.object_map.objects) == 2
    assert sent(carrying, "object_map") == [result.object_map]


def test_what_cannot_be_carried_takes_away_what_an_earlier_sketch_had_left(
    carrying, carrier, monkeypatch
):
    first = GoalHandle(carrying.action_server, with_zone(goal()))
    carrying.action_server.execute(first)
    assert sent(carrying, "route")[-1].poses
    assert any(sent(carrying, "keepout_mask")[-1].data)
    carrier.error = InvalidRequestError("the zone crosses itself", "INVALID_FIELD", "features[0]")
    order = []
    for topic, publisher in carrying.publishers.items():
        monkeypatch.setattr(publisher, "publish", lambda sent, to=topic: order.append((to, sent)))
    handle = GoalHandle(carrying.action_server, with_zone(goal()))
    result = carrying.action_server.execute(handle)
    assert (handle.status, result.error) == ("aborted", "the zone crosses itself")
    told = {topic.removeprefix("/sketchmatch/"): message for topic, message in order}
    assert told["route"].poses == []
    assert not any(told["keepout_mask"].data)
    # Whoever hears of the new objects has no way of the former sketch any more.
    assert [*told] == ["route", "keepout_mask", "keepout_filter_info", "object_map", "markers"]


def test_what_is_published_of_goals_at_the_same_time_stays_together(carrying, monkeypatch):
    order = []

    def publish(_):
        order.append(get_ident())
        time.sleep(0.005)

    for publisher in carrying.publishers.values():
        monkeypatch.setattr(publisher, "publish", publish)
    goals = [Thread(target=executed, args=(carrying,)) for _ in range(2)]
    for each in goals:
        each.start()
    for each in goals:
        each.join(20)
    assert [len([*same]) for _, same in groupby(order)] == [5, 5]


def test_a_goal_that_begins_after_the_node_was_cleaned_up_is_aborted(carrying):
    handle = GoalHandle(carrying.action_server, goal())
    carrying.go("deactivate", "inactive")
    carrying.go("cleanup", "unconfigured")
    result = carrying.action_server.execute(handle)
    assert handle.status == "aborted"
    assert "cleaned up" in result.error
    carrying.go("configure", "inactive")


def test_routes_are_carried_onto_the_map_that_the_server_keeps(carrying, carrier, server):
    server.kept = put("kept")
    executed(carrying)
    point, stroke = message("geometry_msgs/msg/Point"), message("sketchmatch_msgs/msg/Stroke")
    line = stroke(points=[point(x=1.0), point(x=3.0)])
    wanted = message("sketchmatch_msgs/msg/CarryRequest")(routes=[line], y_axis=1)
    carrying.services["~/carry"](wanted)
    assert [map_.stored_scene for _, map_, *_ in carrier.asked] == ["kept", "kept"]
    carrier.error = NotFoundError("no scene is called kept", "")
    assert "no scene" in carrying.services["~/carry"](wanted).error
    names = [map_.stored_scene for _, map_, *_ in carrier.asked[2:]]
    assert names == ["kept", ""]


def test_more_of_the_latest_sketch_is_carried_on_demand(carrying, carrier):
    point, stroke = message("geometry_msgs/msg/Point"), message("sketchmatch_msgs/msg/Stroke")
    line = stroke(points=[point(x=100.0, y=-200.0), point(x=300.0, y=-200.0)])
    wanted = message("sketchmatch_msgs/msg/CarryRequest")(routes=[line], zones=[line], y_axis=1)
    early = carrying.services["~/carry"](wanted)
    assert (early.routes, early.zones) == ([], [])
    assert "send a goal to match_sketch first" in early.error
    executed(carrying)
    carrier.notes = ["route 0: Nothing after point 1 can be reached."]
    found = carrying.services["~/carry"](wanted)
    assert found.notes == carrier.notes
    assert carrying.said[-1] == ("warning", f"not carried as drawn: {carrier.notes[0]}")
    places = [(pose.pose.position.x, pose.pose.position.y) for pose in found.routes[0].poses]
    assert places == [(1, 2), (3, 2)]
    assert [(p.x, p.y) for p in found.zones[0].points] == [(1, 2), (3, 2)]
    assert (found.error, found.routes[0].header.frame_id) == ("", "site")
    carrier.error = InvalidRequestError("it folds", "INVALID_FIELD", "object_map")
    assert carrying.services["~/carry"](wanted).error == "it folds"


@pytest.fixture
def transferring(ros, server):
    """An active node that has the server carry, and keep its map."""
    made = ros.node.SketchmatchNode(ros.carrying.carry)
    made.parameters |= {"address": server.address, "timeout": 45.0}
    made.go("configure", "inactive")
    made.go("activate", "active")
    made.subscriptions["map"].callback(room())
    server.kept = put("kept")
    return made


def test_what_the_server_changed_about_a_route_is_a_warning(transferring, server):
    change = transfer_service_pb2.FeatureChange(sentence="The route ends there.")
    server.transferred = transfer_service_pb2.TransferResponse(
        features=[transfer_service_pb2.CarriedFeature(changes=[change])]
    )
    executed(transferring)
    told = "not carried as drawn: route 0: The route ends there."
    assert ("warning", told) in transferring.said


def test_every_call_ends_after_the_timeout(transferring, server):
    handle, _ = executed(transferring)
    assert handle.status == "succeeded"
    assert [kind for kind, _ in asked(server)] == ["PutScene", "Match", "Transfer"]
    assert server.times == pytest.approx([45, 45, 45], abs=5)


@pytest.mark.parametrize(
    ("held", "kinds"),
    [
        (scene_service_pb2.PutSceneRequest, ["PutScene"]),
        (transfer_service_pb2.TransferRequest, ["PutScene", "Match", "Transfer"]),
    ],
)
@pytest.mark.parametrize("end", ["canceled", "aborted"])
def test_a_goal_that_is_over_waits_for_no_call_and_leaves_all_as_it_was(
    transferring, server, held, kinds, end
):
    server.holds = held
    handle = GoalHandle(transferring.action_server, with_zone(goal()))
    results = []
    worker = Thread(target=lambda: results.append(transferring.action_server.execute(handle)))
    worker.start()
    wait_until(lambda: any(isinstance(each, held) for each in server.requests), "nothing is asked")
    if end == "canceled":
        handle.cancel()
    else:
        transferring.go("deactivate", "inactive")
    worker.join(20)
    assert handle.status == end
    assert results[0].error == "the goal was cancelled before its end"
    assert {topic: each.sent for topic, each in transferring.publishers.items() if each.sent} == {}
    server.released.set()
    assert [kind for kind, _ in asked(server)] == kinds


def test_zones_are_refused_where_nothing_carries_them(node):
    assert node.action_server.accepts(with_zone(goal())) is GoalResponse.REJECT
    assert "cannot transfer zones" in node.said[-1][1]
    assert node.services == {}


def test_the_action_runs_beside_itself(node):
    assert type(node.action_server.group).__name__ == "ReentrantCallbackGroup"
    assert node.action_server.name == "~/match_sketch"
