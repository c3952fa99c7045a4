"""``ros2 launch`` in a few lines, for where it cannot be had: there is no wheel of it.

It starts the program that the package installs with its parameters, and does what the launch file
does: it configures the node, and activates it.
"""

import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import rclpy
from ament_index_python.packages import get_package_prefix
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState


def main(verb: str, package: str, _file: str, parameters: str) -> None:
    assert verb == "launch"
    program = Path(get_package_prefix(package)) / "lib" / package / "sketchmatch"
    renamed = ["--ros-args", "--remap", "__node:=sketchmatch"]
    file = parameters.removeprefix("params_file:=")
    launched = subprocess.Popen([program, *renamed, "--params-file", file])
    rclpy.init()
    node = rclpy.create_node("launcher")
    client = node.create_client(ChangeState, "/sketchmatch/change_state")
    client.wait_for_service()
    for transition in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
        request = ChangeState.Request()
        request.transition.id = transition
        future = client.call_async(request)
        rclpy.spin_until_future_complete(node, future)
        assert future.result().success
    node.destroy_node()
    rclpy.try_shutdown()
    launched.wait()


if __name__ == "__main__":
    with suppress(KeyboardInterrupt):
        main(*sys.argv[1:])
