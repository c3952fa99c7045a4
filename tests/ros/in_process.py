"""ROS within one process: what somebody who is no node of ours uses of rclpy.

It leads to a node of :mod:`tests.ros.rclpy_stand_in`: what is published comes when somebody spins,
what is latched comes late too, and a goal is executed in a thread of its own.
"""

from __future__ import annotations

import sys
import time
from concurrent.futures import Future, ThreadPoolExecutor
from types import ModuleType, SimpleNamespace

from tests.ros.messages import message
from tests.ros.rclpy_stand_in import GoalHandle, GoalResponse, TransitionCallbackReturn

GOAL = {"succeeded": 4, "canceled": 5, "aborted": 6}
"""As in action_msgs/msg/GoalStatus."""
STATES = {"unconfigured": 1, "inactive": 2, "active": 3, "finalized": 4}
"""As in lifecycle_msgs/msg/State."""
TRANSITIONS = {
    1: ("configure", "inactive"),
    2: ("cleanup", "unconfigured"),
    3: ("activate", "active"),
    4: ("deactivate", "inactive"),
}
"""As in lifecycle_msgs/msg/Transition."""


class Ros:
    """The node that was launched, and how others reach it."""

    def __init__(self, node):
        self.node, self.latched, self.hearing, self.waiting = node, {}, [], []
        self.goals = ThreadPoolExecutor()

    def change(self, number):
        name, state = TRANSITIONS[number]
        done = self.node.go(name, state) is TransitionCallbackReturn.SUCCESS
        for topic, last in self.latched.items():
            if name == "configure":
                self.node.subscriptions[topic].callback(last)
        return done

    def publish(self, topic, kind, sent):
        assert isinstance(sent, kind)
        self.latched[topic] = sent
        if topic in self.node.subscriptions:
            self.node.subscriptions[topic].callback(sent)

    def call(self, name, request):
        if name == "get_state":
            state = message("lifecycle_msgs/msg/State")(id=STATES[self.node.state])
            return SimpleNamespace(current_state=state)
        if name == "change_state":
            return SimpleNamespace(success=self.change(request.transition.id))
        return self.node.services[f"~/{name}"](request)

    def spin(self):
        """Tell what has been published and fed back since."""
        for known in self.hearing:
            publisher = self.node.publishers.get(known.topic)
            for sent in publisher.sent[known.count :] if publisher else ():
                assert isinstance(sent, known.kind)
                known.count += 1
                known.callback(sent)
        for handle, callback in self.waiting:
            while handle.feedback:
                callback(SimpleNamespace(feedback=handle.feedback.pop(0)))
        time.sleep(0.005)


class Person:
    """A node of somebody else."""

    def __init__(self, ros):
        self.ros = ros

    def create_publisher(self, kind, topic, _qos):
        return SimpleNamespace(publish=lambda sent: self.ros.publish(topic, kind, sent))

    def create_subscription(self, kind, topic, callback, _qos):
        self.ros.hearing.append(SimpleNamespace(kind=kind, topic=topic, callback=callback, count=0))

    def create_client(self, _kind, name):
        name = name.removeprefix("/sketchmatch/")
        return SimpleNamespace(
            wait_for_service=lambda timeout_sec: timeout_sec > 0,
            call_async=lambda request: told(self.ros.call(name, request)),
        )


class ActionClient:
    def __init__(self, node, _kind, name):
        assert name == "/sketchmatch/match_sketch"
        self.ros = node.ros

    def wait_for_server(self, timeout_sec):
        return timeout_sec > 0

    def send_goal_async(self, goal, feedback_callback=None):
        server = self.ros.node.action_server
        if server.accepts(goal) is not GoalResponse.ACCEPT:
            return told(SimpleNamespace(accepted=False))
        handle = GoalHandle(server, goal)
        if feedback_callback:
            self.ros.waiting.append((handle, feedback_callback))

        def execute():
            result = server.execute(handle)
            return SimpleNamespace(status=GOAL[handle.status], result=result)

        def cancel():
            handle.cancel()
            return told(SimpleNamespace(goals_canceling=[handle]))

        ended = self.ros.goals.submit(execute)
        return told(
            SimpleNamespace(accepted=True, get_result_async=lambda: ended, cancel_goal_async=cancel)
        )


def told(answer):
    future = Future()
    future.set_result(answer)
    return future


def install(node):
    """Make the modules importable beside the stand-ins for a node's; return the person's node."""
    person = Person(Ros(node))

    def spin_until_future_complete(known, future, timeout_sec):
        end = time.monotonic() + timeout_sec
        while not future.done() and time.monotonic() < end:
            known.ros.spin()

    def spin_once(known, timeout_sec):
        assert timeout_sec > 0
        known.ros.spin()

    rclpy = sys.modules["rclpy"]
    rclpy.spin_once = spin_once
    rclpy.spin_until_future_complete = spin_until_future_complete
    sys.modules["rclpy.action"].ActionClient = ActionClient
    services = ModuleType("lifecycle_msgs.srv")
    services.GetState = SimpleNamespace(Request=SimpleNamespace)
    services.ChangeState = SimpleNamespace(
        Request=lambda: SimpleNamespace(transition=message("lifecycle_msgs/msg/Transition")())
    )
    sys.modules["lifecycle_msgs.srv"] = services
    return person
