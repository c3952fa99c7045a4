"""What :mod:`sketchmatch_ros.node` uses of rclpy, with the rules that a node may break.

A goal is a state machine as in rcl_action: only one that is being cancelled can have been
cancelled, and it is being cancelled only after the node has agreed. Publishers send while the node
is active.
"""

from __future__ import annotations

import sys
from enum import Enum
from types import ModuleType, SimpleNamespace


class TransitionCallbackReturn(Enum):
    SUCCESS, FAILURE, ERROR = range(3)


class GoalResponse(Enum):
    REJECT, ACCEPT = 1, 2


class CancelResponse(Enum):
    REJECT, ACCEPT = 1, 2


class Policy(Enum):
    TRANSIENT_LOCAL, RELIABLE = range(2)


class QoSProfile(SimpleNamespace):
    pass


class Publisher:
    def __init__(self, node, kind, topic, qos):
        self.node, self.kind, self.qos = node, kind, qos
        self.topic_name = topic.replace("~", "/sketchmatch")
        self.sent = []

    def publish(self, message):
        assert isinstance(message, self.kind)
        if self.node.state == "active":
            self.sent.append(message)


class LifecycleNode:
    def __init__(self, name):
        self.name, self.state = name, "unconfigured"
        self.parameters, self.publishers, self.subscriptions = {}, {}, {}
        self.services, self.said = {}, []

    def declare_parameter(self, name, default):
        self.parameters.setdefault(name, default)

    def get_parameter(self, name):
        return SimpleNamespace(value=self.parameters[name])

    def get_logger(self):
        def level(name):
            return lambda text: self.said.append((name, text))

        return SimpleNamespace(**{name: level(name) for name in ("info", "warning", "error")})

    def get_clock(self):
        time = sys.modules["builtin_interfaces.msg"].Time(sec=7, nanosec=5)
        return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=lambda: time))

    def create_lifecycle_publisher(self, kind, topic, qos):
        publisher = Publisher(self, kind, topic, qos)
        self.publishers[publisher.topic_name] = publisher
        return publisher

    def destroy_lifecycle_publisher(self, publisher):
        del self.publishers[publisher.topic_name]

    def create_subscription(self, kind, topic, callback, qos):
        self.subscriptions[topic] = SimpleNamespace(
            kind=kind, callback=callback, qos=qos, topic=topic
        )
        return self.subscriptions[topic]

    def destroy_subscription(self, subscription):
        del self.subscriptions[subscription.topic]

    def create_service(self, kind, name, callback, *, callback_group):
        assert type(callback_group).__name__ == "ReentrantCallbackGroup"
        self.services[name] = lambda request: callback(request, kind.Response())
        return name

    def destroy_service(self, service):
        del self.services[service]

    def on_configure(self, _state):
        return TransitionCallbackReturn.SUCCESS

    on_activate = on_deactivate = on_cleanup = on_shutdown = on_configure

    def go(self, transition, state):
        """Do a transition as the lifecycle does: into its state if the node agrees."""
        done = getattr(self, f"on_{transition}")(self.state)
        if done is TransitionCallbackReturn.SUCCESS:
            self.state = state
        return done


class ActionServer:
    def __init__(
        self, node, kind, name, *, execute_callback, goal_callback, cancel_callback, callback_group
    ):
        self.node, self.kind, self.name, self.group = node, kind, name, callback_group
        self.execute, self.accepts, self.cancels = execute_callback, goal_callback, cancel_callback
        self.destroyed = False
        node.action_server = self

    def destroy(self):
        self.destroyed = True


class GoalHandle:
    def __init__(self, server, goal):
        self._server, self.request = server, goal
        self.status, self.feedback = "executing", []

    @property
    def is_cancel_requested(self):
        return self.status == "canceling"

    def cancel(self):
        """Ask for it as a client does."""
        if self._server.cancels(self) is CancelResponse.ACCEPT:
            assert self.status == "executing", f"a goal that is {self.status} cannot be cancelled"
            self.status = "canceling"

    def publish_feedback(self, feedback):
        assert isinstance(feedback, self._server.kind.Feedback)
        self.feedback.append(feedback)

    def succeed(self):
        self._end("succeeded", "executing", "canceling")

    def abort(self):
        self._end("aborted", "executing", "canceling")

    def canceled(self):
        self._end("canceled", "canceling")

    def _end(self, state, *allowed):
        assert self.status in allowed, f"a goal that is {self.status} cannot have {state}"
        self.status = state


def install():
    """Make the modules importable, and return their names."""
    parts = {
        "rclpy": {},
        "rclpy.action": {
            "ActionServer": ActionServer,
            "CancelResponse": CancelResponse,
            "GoalResponse": GoalResponse,
        },
        "rclpy.callback_groups": {"ReentrantCallbackGroup": type("ReentrantCallbackGroup", (), {})},
        "rclpy.executors": {"MultiThreadedExecutor": object},
        "rclpy.lifecycle": {
            "LifecycleNode": LifecycleNode,
            "TransitionCallbackReturn": TransitionCallbackReturn,
        },
        "rclpy.qos": {
            "DurabilityPolicy": Policy,
            "QoSProfile": QoSProfile,
            "ReliabilityPolicy": Policy,
        },
    }
    for name, content in parts.items():
        module = ModuleType(name)
        module.__dict__.update(content)
        sys.modules[name] = module
    return [*parts]
