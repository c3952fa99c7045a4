"""The lifecycle node: topics, an action, and a life around :mod:`sketchmatch_ros.matching`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import Lock

import rclpy
from nav2_msgs.msg import CostmapFilterInfo
from nav_msgs.msg import OccupancyGrid, Path
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sketchmatch_msgs.action import MatchSketch
from sketchmatch_msgs.msg import ObjectMap
from sketchmatch_msgs.srv import Carry
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from sketchmatch_client import CallCancelledError, Client, SketchmatchError
from sketchmatch_proto.v1.source_pb2 import Source
from sketchmatch_ros import conversions
from sketchmatch_ros.carrying import carry
from sketchmatch_ros.matching import Carrier, Features, Matching, Options

__all__ = ["SketchmatchNode", "main"]

# Whoever comes late gets the last message too, as with maps of map_server.
_LATCHED = QoSProfile(
    depth=1,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
    reliability=ReliabilityPolicy.RELIABLE,
)
_PARAMETERS = {
    "address": "localhost:50051",
    "token_file": "",
    "root_certificates": "",
    "map_topic": "map",
    "profile": "",
    "time_budget": 5.0,
    "timeout": 60.0,
    "radius": 0.0,
}
"""Defaults; ``config/sketchmatch.yaml`` says what each is."""


@dataclass(frozen=True)
class _Map:
    """A map as it came, and as the server is told of it."""

    grid: OccupancyGrid
    source: Source


@dataclass(frozen=True)
class _Matched:
    """The last match: what was matched, which sketched object is which, and on what map."""

    sketch: Source
    map_: _Map
    partners: Mapping[int, int]


class SketchmatchNode(LifecycleNode):
    """Matches sketches with the latest map while it is active.

    Parameters
    ----------
    carry
        Carries routes and zones of a sketch into the map's frame. None: only the matched objects
        are published.
    """

    def __init__(self, carry: Carrier | None = None) -> None:
        super().__init__("sketchmatch")
        for name, default in _PARAMETERS.items():
            self.declare_parameter(name, default)
        self._carry = carry
        self._active = False
        self._map: _Map | None = None
        self._last: _Matched | None = None
        # Goals are executed beside each other: what is published of one belongs together.
        self._publishing = Lock()

    def on_configure(self, state: object) -> TransitionCallbackReturn:
        """Make the client and all topics; the server need not be there yet."""
        try:
            self._client = Client(
                self._said("address"),
                token_file=self._said("token_file") or None,
                root_certificates=self._said("root_certificates") or None,
                timeout=self._said("timeout") or None,
            )
        except SketchmatchError as error:
            self.get_logger().error(f"cannot be configured: {error}")
            return TransitionCallbackReturn.FAILURE
        self._matching = Matching(self._client)
        publish = self.create_lifecycle_publisher
        self._answers = publish(ObjectMap, "~/object_map", _LATCHED)
        self._markers = publish(MarkerArray, "~/markers", _LATCHED)
        self._published = [self._answers, self._markers]
        if self._carry is not None:
            self._route = publish(Path, "~/route", _LATCHED)
            self._mask = publish(OccupancyGrid, "~/keepout_mask", _LATCHED)
            self._filter = publish(CostmapFilterInfo, "~/keepout_filter_info", _LATCHED)
            self._published += [self._route, self._mask, self._filter]
            self._service = self.create_service(
                Carry, "~/carry", self.carry_more, callback_group=ReentrantCallbackGroup()
            )
        self._maps = self.create_subscription(
            OccupancyGrid, self._said("map_topic"), self.take_map, _LATCHED
        )
        self._server = ActionServer(
            self,
            MatchSketch,
            "~/match_sketch",
            execute_callback=self.execute,
            goal_callback=self.accept,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=ReentrantCallbackGroup(),
        )
        return super().on_configure(state)

    def on_activate(self, state: object) -> TransitionCallbackReturn:
        """Take goals."""
        self._active = True
        return super().on_activate(state)

    def on_deactivate(self, state: object) -> TransitionCallbackReturn:
        """Take no more goals, and stop those that go on."""
        self._active = False
        return super().on_deactivate(state)

    def on_cleanup(self, state: object) -> TransitionCallbackReturn:
        """Give everything back that was made."""
        done = super().on_cleanup(state)
        self._give_back()
        return done

    def on_shutdown(self, state: object) -> TransitionCallbackReturn:
        """Stop, and give everything back."""
        done = super().on_shutdown(state)
        self._active = False
        if hasattr(self, "_client"):
            self._give_back()
        return done

    def take_map(self, grid: OccupancyGrid) -> None:
        """Keep a map, in place of the one before."""
        try:
            source = conversions.map_source(grid)
        except SketchmatchError as error:
            self.get_logger().error(f"the new map cannot be used, the former one stays: {error}")
            return
        self._map = _Map(grid, source)
        self.get_logger().info(
            f"has a map of {grid.info.width} x {grid.info.height} cells in {grid.header.frame_id}"
        )

    def accept(self, goal: MatchSketch.Goal) -> GoalResponse:
        """Take a goal while the node is active, has a map, and there is something in the sketch."""
        if not self._active:
            reason = "the node is not active; activate it"
        elif self._map is None:
            reason = f"no map has arrived on {self._said('map_topic')} yet; start map_server"
        elif not goal.sketch.strokes:
            reason = "the sketch has no strokes; draw two objects or more"
        elif goal.sketch.zones and self._carry is None:
            reason = "this node cannot transfer zones; leave them out"
        else:
            return GoalResponse.ACCEPT
        self.get_logger().warning(f"refuses a goal: {reason}")
        return GoalResponse.REJECT

    def execute(self, goal_handle: object) -> MatchSketch.Result:
        """Match, publish the answer, and end the goal."""
        goal, map_ = goal_handle.request, self._map
        answer = ObjectMap()

        def is_over() -> bool:
            return goal_handle.is_cancel_requested or not self._active

        try:
            if map_ is None:
                raise CallCancelledError("the node was cleaned up after it took the goal")
            sketch = conversions.sketch_source(goal.sketch)
            match = self._matching.match(
                sketch,
                map_.source,
                self._options(goal),
                on_progress=lambda now: goal_handle.publish_feedback(conversions.feedback(now)),
                is_over=is_over,
            )
            answer = conversions.object_map(match, self._header(map_.grid))
            matched = _Matched(sketch, map_, match.object_map)
            drawn = conversions.drawn_features(goal.sketch, match)
            self._publish(matched, answer, drawn, is_over)
        except SketchmatchError as error:
            if isinstance(error, CallCancelledError) and goal_handle.is_cancel_requested:
                goal_handle.canceled()
            else:
                self.get_logger().error(str(error))
                goal_handle.abort()
            return conversions.failure(error, answer)
        goal_handle.succeed()
        return MatchSketch.Result(object_map=answer)

    def carry_more(self, request: Carry.Request, response: Carry.Response) -> Carry.Response:
        """Carry routes and zones of the sketch that was matched last."""
        last = self._last
        if not self._active or last is None:
            response.error = "no sketch was matched yet; send a goal to match_sketch first"
            return response
        drawn = Features(
            conversions.upright(request.routes, request.y_axis),
            conversions.upright(request.zones, request.y_axis),
        )
        try:
            found = self._carried(last, drawn, is_over=lambda: not self._active)
            return conversions.carried(found, self._header(last.map_.grid))
        except SketchmatchError as error:
            response.error = str(error)
            return response

    def _publish(
        self, last: _Matched, answer: ObjectMap, drawn: Features, is_over: Callable[[], bool]
    ) -> None:
        """Publish an answer, and its routes and zones before it.

        Where there are none, or they cannot be carried, empty ones take the place of those of an
        earlier sketch, which nobody may go by any more. A goal that is over leaves all as it was.
        """
        carried, error = Features(), None
        if self._carry is not None and (drawn.routes or drawn.zones):
            try:
                carried = self._carried(last, drawn, is_over)
            except SketchmatchError as problem:
                if is_over():
                    raise
                error = problem
        grid = last.map_.grid
        with self._publishing:
            self._last = last
            if self._carry is not None:
                header = self._header(grid)
                route = next(iter(carried.routes), ())
                self._route.publish(conversions.route_path(route, header))
                self._mask.publish(conversions.keepout_mask(carried.zones, grid))
                self._filter.publish(conversions.filter_info(self._mask.topic_name, header))
            self._answers.publish(answer)
            self._markers.publish(conversions.markers(answer))
        if error is not None:
            raise error

    def _carried(self, last: _Matched, drawn: Features, is_over: Callable[[], bool]) -> Features:
        def carry(map_: Source) -> Features:
            radius = self._said("radius")
            return self._carry(self._client, last.sketch, map_, last.partners, drawn, radius)

        found = self._matching.carried(carry, last.map_.source, is_over)
        for note in found.notes:
            self.get_logger().warning(f"not carried as drawn: {note}")
        return found

    def _header(self, grid: OccupancyGrid) -> Header:
        return Header(stamp=self.get_clock().now().to_msg(), frame_id=grid.header.frame_id)

    def _options(self, goal: MatchSketch.Goal) -> Options:
        return Options(
            profile=goal.profile or self._said("profile"),
            time_budget=goal.time_budget or self._said("time_budget"),
            seed=goal.seed,
        )

    def _said(self, parameter: str) -> object:
        return self.get_parameter(parameter).value

    def _give_back(self) -> None:
        self._matching.close()
        self._server.destroy()
        self.destroy_subscription(self._maps)
        for publisher in self._published:
            self.destroy_lifecycle_publisher(publisher)
        if self._carry is not None:
            self.destroy_service(self._service)
        self._client.close()
        self._map = self._last = None
        del self._client


def main() -> None:
    """Run the node until it is interrupted."""
    rclpy.init()
    executor = MultiThreadedExecutor()  # a goal is executed while another is being cancelled
    node = SketchmatchNode(carry)
    executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
