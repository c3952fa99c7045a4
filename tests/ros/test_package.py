"""What ROS's tools read of the packages fits what is in them."""

import ast
import json
import re
import subprocess
import tomllib
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

from tests.ros.messages import OURS, store
from tests.tools import ROOT, require

ROS = ROOT / "clients" / "ros"
PACKAGE = ROS / "sketchmatch_ros"
README = (ROS / "README.md").read_text(encoding="utf-8")


def depends(folder):
    root = ElementTree.parse(folder / "package.xml").getroot()
    return {item.text for item in root if item.tag.endswith("depend")}


def imported(folder):
    trees = [ast.parse(file.read_text("utf-8")) for file in folder.rglob("*.py")]
    nodes = [node for tree in trees for node in ast.walk(tree)]
    names = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    names += [node.module for node in nodes if isinstance(node, ast.ImportFrom) and node.module]
    return {name.partition(".")[0] for name in names}


def test_every_ros_package_that_is_imported_is_depended_on():
    ros = {name for name in imported(PACKAGE) if name.endswith("_msgs")} | {"rclpy", "launch_ros"}
    assert ros <= depends(PACKAGE)
    assert "ament_index_python" in depends(PACKAGE)


def test_every_interface_is_generated_and_its_parts_are_depended_on():
    text = (OURS / "CMakeLists.txt").read_text("utf-8")
    files = {
        str(file.relative_to(OURS))
        for kind in ("msg", "action", "srv")
        for file in (OURS / kind).iterdir()
    }
    assert set(re.findall(r'"((?:msg|action|srv)/\w+\.\w+)"', text)) == files
    used = {name.partition("/")[0] for name in re.findall(r"\w+/msg/\w+", str(ours()))}
    assert used - {"sketchmatch_msgs", "builtin_interfaces"} <= depends(OURS)


@pytest.mark.slow
def test_ros_own_tools_take_every_interface(tmp_path):
    python = Path("/usr/bin/python3")  # whose package python3-rosidl is
    found = (
        python.exists()
        and not subprocess.run(
            [python, "-c", "import em, rosidl_adapter, rosidl_parser"],
            capture_output=True,
            check=False,
        ).returncode
    )
    require(found, "rosidl, by apt-get install python3-empy python3-rosidl")
    done = subprocess.run(
        [python, "-c", _PARSE, OURS, tmp_path],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout.splitlines()[-1]) == {
        "MatchSketch": "Action",
        "MatchedObject": "Message",
        "ObjectGroup": "Message",
        "ObjectMap": "Message",
        "Sketch": "Message",
        "Stroke": "Message",
        "Carry": "Service",
    }


_PARSE = """
import json, sys
from pathlib import Path
from rosidl_adapter import convert_to_idl
from rosidl_parser.definition import Action, IdlLocator, Message, Service
from rosidl_parser.parser import parse_idl_file

ours, out = Path(sys.argv[1]), Path(sys.argv[2])
kinds = {}
for kind in ("action", "msg", "srv"):
    for file in sorted((ours / kind).iterdir()):
        convert_to_idl(ours, "sketchmatch_msgs", file.relative_to(ours), out)
        (idl,) = out.rglob(file.stem + ".idl")
        parsed = parse_idl_file(IdlLocator(out, idl.relative_to(out)))
        (one,) = [
            type(each).__name__
            for each in parsed.content.elements
            if isinstance(each, (Action, Message, Service))
        ]
        kinds[file.stem] = one
print(json.dumps(kinds))
"""
"""Makes IDL of every interface, as a build does, and reads it."""


def ours():
    return [
        fields for name, fields in store().fielddefs.items() if name.startswith("sketchmatch_msgs")
    ]


def test_the_parameters_file_has_every_parameter_with_its_default(ros):
    text = (PACKAGE / "config" / "sketchmatch.yaml").read_text("utf-8")
    assert yaml.safe_load(text)["sketchmatch"]["ros__parameters"] == ros.node._PARAMETERS
    for name in ros.node._PARAMETERS:
        assert f"`{name}`" in README


def test_everything_that_setup_installs_is_there():
    listed = re.findall(r', \["([^"]+)"\]\)', (PACKAGE / "setup.py").read_text("utf-8"))
    for name in listed:
        assert (PACKAGE / name.replace("{PACKAGE}", "sketchmatch_ros")).exists(), name
    assert {"package.xml", "launch/sketchmatch.launch.py"} < set(listed)


def test_rviz_shows_the_topics_that_the_node_has():
    shown = yaml.safe_load((PACKAGE / "rviz" / "sketchmatch.rviz").read_text("utf-8"))
    displays = shown["Visualization Manager"]["Displays"]
    topics = {item["Topic"]["Value"] for item in displays} - {"/map"}
    code = (PACKAGE / "sketchmatch_ros" / "node.py").read_text("utf-8")
    published = set(re.findall(r'"~/(\w+)", _LATCHED', code))
    assert topics <= {f"/sketchmatch/{name}" for name in published}
    for name in (*published, "match_sketch", "carry"):
        assert f"`~/{name}`" in README


RECIPE = (ROS / "Dockerfile").read_text("utf-8")
STEPS = [
    (word, rest.split())
    for word, _, rest in (
        line.partition(" ")
        for line in re.sub(r"^#.*\n|\\\n", "", RECIPE, flags=re.M).splitlines()
        if line
    )
]
# https://github.com/ros2/variants: what the image has of what the packages depend on.
ROS_BASE = {
    "action_msgs",
    "ament_cmake",
    "ament_index_python",
    "geometry_msgs",
    "launch",
    "launch_ros",
    "lifecycle_msgs",
    "nav_msgs",
    "rclpy",
    "ros2launch",
    "rosidl_default_generators",
    "rosidl_default_runtime",
    "std_msgs",
}


def test_the_recipe_is_made_of_steps_that_refer_to_each_other_and_to_what_there_is():
    assert {word for word, _ in STEPS} == {"FROM", "RUN", "WORKDIR", "COPY", "ENV", "CMD"}
    stages = {"ros:jazzy-ros-base"}
    for word, parts in STEPS:
        if word == "FROM":
            assert parts[0] in stages
            stages |= set(parts[2:])
        if word == "COPY":
            for source in parts[:-1]:
                assert (ROOT / source).exists(), source
        if word == "RUN" and "apt-get" in parts:
            assert {"update", "--yes", "--no-install-recommends"} <= set(parts)
            assert parts[-2:] == ["-rf", "/var/lib/apt/lists/*"]
    assert "--target test" in RECIPE
    assert "test" in stages


def test_the_recipe_installs_what_the_packages_depend_on():
    installed = {part for word, parts in STEPS if word == "RUN" for part in parts}
    wanted = depends(PACKAGE) | depends(OURS)
    for name in wanted - ROS_BASE - {"sketchmatch_msgs"}:
        ros = f"ros-jazzy-{name.replace('_', '-')}"
        assert {name, ros} & installed, name
    copied = {Path(parts[-1]).name for word, parts in STEPS if word == "COPY"}
    assert {"sketchmatch_msgs", "sketchmatch_ros"} <= copied
    named = {ElementTree.parse(each / "package.xml").findtext("name") for each in (PACKAGE, OURS)}
    assert named == {"sketchmatch_msgs", "sketchmatch_ros"}
    assert ("RUN", "test") in {(word, parts[4]) for word, parts in STEPS if "colcon" in parts[3:4]}


def test_the_recipe_copies_all_that_the_server_is_built_of():
    copied = {
        source
        for word, parts in STEPS
        if word == "COPY" and parts[-1].startswith("/sketchmatch/")
        for source in parts[:-1]
    }
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    wanted = [
        "pyproject.toml",
        project["project"]["readme"],
        *project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"],
        *project["tool"]["hatch"]["build"]["targets"]["sdist"]["include"],
    ]
    for path in wanted:
        assert any(Path(path).is_relative_to(source) for source in copied), path
