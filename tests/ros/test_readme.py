"""What the README shows, block by block, between stand-ins for what ROS brings.

``test_real_server.py`` sends the goal that it shows.
"""

import subprocess
import sys
import tomllib
from types import ModuleType, SimpleNamespace

import yaml

from tests.pages import Page
from tests.ros.messages import message
from tests.ros.rclpy_stand_in import Policy
from tests.tools import ROOT

PAGE = Page("clients/ros/README.md", __name__)
COMMANDS = PAGE.take_one("sh", "ros2 launch")
GOAL = PAGE.take_one("yaml", "strokes:")
DRIVER = PAGE.take_one("python", "FollowPath")
COSTMAP = PAGE.take_one("yaml", "costmap")
_STAND_IN = """\
#!/bin/bash
printf '%s\\n' "$(basename "$0")" "$@" --- >> "$SAID"
if [ "$(basename "$0") $1" = "colcon build" ]; then
  mkdir -p install
  ls src > built.txt
  echo "export SOURCED=yes" > install/setup.bash
fi
"""


def test_the_commands_put_both_packages_where_they_are_built_and_send_the_goal(tmp_path):
    tools, home = tmp_path / "tools", tmp_path / "home"
    tools.mkdir()
    (home / "workspace" / "src").mkdir(parents=True)
    for name in ("pip", "rosdep", "colcon", "ros2"):
        (tools / name).write_text(_STAND_IN)
        (tools / name).chmod(0o755)
    (tmp_path / "sketchmatch").symlink_to(ROOT)
    (home / "workspace" / "goal.yaml").write_text(GOAL.text, "utf-8")
    said = tmp_path / "said.txt"
    subprocess.run(
        ["bash", "-euo", "pipefail", "-c", COMMANDS.text + '\necho "$SOURCED"'],
        cwd=tmp_path,
        env={"PATH": f"{tools}:/usr/bin:/bin", "HOME": str(home), "SAID": str(said)},
        check=True,
    )
    built = (home / "workspace" / "built.txt").read_text().split()
    assert built == ["sketchmatch_msgs", "sketchmatch_ros"]
    calls = [
        call.split("\n") for call in said.read_text("utf-8").removesuffix("---\n").split("\n---\n")
    ]
    assert [call[:2] for call in calls] == [
        ["pip", "install"],
        ["rosdep", "install"],
        ["colcon", "build"],
        ["ros2", "launch"],
        ["ros2", "action"],
    ]
    client, *_, launch, action = calls
    project = tomllib.loads((tmp_path / client[-1] / "pyproject.toml").read_text("utf-8"))
    assert project["project"]["name"] == "sketchmatch-client"
    package, file, argument = launch[2:5]
    described = (ROOT / "clients" / "ros" / package / "launch" / file).read_text("utf-8")
    assert f'DeclareLaunchArgument("{argument.partition(":=")[0]}"' in described
    assert action[2:6] == [
        "send_goal",
        "--feedback",
        "/sketchmatch/match_sketch",
        "sketchmatch_msgs/action/MatchSketch",
    ]
    assert (ROOT / "clients" / "ros" / f"{action[5]}.action").is_file()
    assert yaml.safe_load("\n".join(action[6:])) == yaml.safe_load(GOAL.text)


def test_the_program_drives_each_route_that_is_published(ros, monkeypatch):
    del ros
    path, pose = message("nav_msgs/msg/Path"), message("geometry_msgs/msg/PoseStamped")
    route = path(poses=[pose(), pose()])
    told, heard = [], {}

    class ActionClient:
        def __init__(self, node, kind, name):
            assert node.name == "drives_drawn_routes"
            self.kind, self.name, self.waited = kind, name, False

        def wait_for_server(self):
            self.waited = True

        def send_goal_async(self, goal):
            assert self.waited
            assert isinstance(goal, self.kind.Goal)
            told.append((self.name, goal.path))

    class Node:
        def __init__(self, name):
            self.name = name

        def create_subscription(self, kind, topic, callback, qos):
            assert qos.durability is Policy.TRANSIENT_LOCAL
            heard[topic] = (kind, callback)

    def spin(node):
        assert isinstance(node, Node)
        ((topic, (kind, callback)),) = heard.items()
        assert (topic, kind) == ("/sketchmatch/route", path)
        callback(path())
        callback(route)

    rclpy = ModuleType("rclpy")
    rclpy.init, rclpy.spin = list, spin
    parts = {
        "rclpy": rclpy,
        "rclpy.action": SimpleNamespace(ActionClient=ActionClient),
        "rclpy.node": SimpleNamespace(Node=Node),
    }
    for name, part in parts.items():
        monkeypatch.setitem(sys.modules, name, part)
    exec(DRIVER.text, {})
    assert told == [("follow_path", route)]


def test_the_costmap_hears_the_filter_that_the_node_publishes(ros):
    del ros
    parameters = yaml.safe_load(COSTMAP.text)["global_costmap"]["global_costmap"]["ros__parameters"]
    (name,) = parameters["filters"]
    topic = parameters[name]["filter_info_topic"]
    code = (ROOT / "clients/ros/sketchmatch_ros/sketchmatch_ros/node.py").read_text("utf-8")
    assert f'"~/{topic.removeprefix("/sketchmatch/")}", _LATCHED' in code
