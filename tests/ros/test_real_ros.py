"""The packages where ROS 2 is: built, launched and tested by ROS's own means.

ROS 2 Jazzy comes as wheels (``jazzy.txt``): build tools, middleware and rclpy. Of what has no
wheel, nav2's interfaces are built from their definitions, and ``ros2 launch`` is ``ros2.py``.
"""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from tests.environment import environment, said_by
from tests.ros.messages import FILTER_INFO, FOLLOW_PATH, FOLLOW_PATH_FEEDBACK, FOLLOW_PATH_RESULT
from tests.ros.test_readme import DRIVER
from tests.tools import ROOT, require

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent
ROS = ROOT / "clients" / "ros"
# What an interpreter that the wheels were built with calls its folders.
_BUILT_WITH = re.compile(r"/opt/python/cp\d+-cp\d+t?(?=[/;\" ])")
_NUMPY = re.compile(r"[^;\" ]*/site-packages/numpy/_core/include")
_CMAKE = """\
cmake_minimum_required(VERSION 3.16)
project(nav2_msgs)
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
find_package(nav_msgs REQUIRED)
find_package(std_msgs REQUIRED)
rosidl_generate_interfaces(nav2_msgs "action/FollowPath.action" "msg/CostmapFilterInfo.msg"
  DEPENDENCIES nav_msgs std_msgs)
ament_package()
"""


class Workspace:
    """A workspace that was built, and what its programs are called with."""

    def __init__(self, folder: Path, programs: Path) -> None:
        self.folder, self.python = folder, programs / "python"
        # Nodes of other machines, and of other tests on this one, are none of ours.
        self.variables = {
            "PATH": f"{programs}:{os.environ['PATH']}",
            "VIRTUAL_ENV": str(programs.parent),
            "AMENT_PREFIX_PATH": str(programs.parent),
            "CMAKE_PREFIX_PATH": str(programs.parent),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_DOMAIN_ID": str(os.getpid() % 100),
            "ROS_LOG_DIR": str(folder / "log"),
            "SKETCHMATCH": str(Path(sys.executable).with_name("sketchmatch")),
        }

    def run(self, command: str) -> list[str]:
        """Run a line of shell with what was built, and return what it prints."""
        sourced = f". install/setup.sh && {command}"
        return said_by("bash", "-e", "-c", sourced, cwd=self.folder, **self.variables)


@pytest.fixture(scope="module")
def workspace(tmp_path_factory):
    """Build the packages as the container's recipe does."""
    require(shutil.which("g++"), "g++")
    folder = tmp_path_factory.mktemp("workspace")
    programs = environment(
        tmp_path_factory.mktemp("ros"),
        *("--requirement", str(HERE / "jazzy.txt"), str(ROOT / "clients" / "python")),
        PIP_CONSTRAINT=str(ROOT / "constraints.txt"),
    )
    make_at_home(programs)
    (programs / "ros2").write_text(f'#!/bin/sh\nexec python {HERE / "ros2.py"} "$@"\n', "utf-8")
    (programs / "ros2").chmod(0o755)
    for name in ("sketchmatch_msgs", "sketchmatch_ros"):
        shutil.copytree(ROS / name, folder / "src" / name)
    write_nav2_msgs(folder / "src" / "nav2_msgs")
    built = Workspace(folder, programs)
    said_by("colcon", "build", cwd=folder, **built.variables)
    return built


def make_at_home(programs: Path) -> None:
    """Have the wheels' CMake files name this interpreter's folders, not those of their builder."""
    (numpy,) = said_by(programs / "python", "-c", "import numpy; print(numpy.get_include())")
    base = sysconfig.get_config_var("base")
    for file in (programs.parent / "share").rglob("*.cmake"):
        text = file.read_text("utf-8")
        mended = _BUILT_WITH.sub(base, _NUMPY.sub(numpy, text))
        if mended != text:
            file.write_text(mended, "utf-8")


def write_nav2_msgs(folder: Path) -> None:
    """Write a package with the interfaces of nav2 that are used."""
    package = (ROS / "sketchmatch_msgs" / "package.xml").read_text("utf-8")
    package = package.replace("<name>sketchmatch_msgs<", "<name>nav2_msgs<")
    follow = "---\n".join((FOLLOW_PATH, FOLLOW_PATH_RESULT, FOLLOW_PATH_FEEDBACK))
    for name, text in {
        "package.xml": package,
        "CMakeLists.txt": _CMAKE,
        "msg/CostmapFilterInfo.msg": FILTER_INFO,
        "action/FollowPath.action": follow,
    }.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, "utf-8")


def test_the_launched_node_passes_its_own_tests(workspace):
    printed = workspace.run(
        "colcon test --packages-select sketchmatch_ros --event-handlers console_direct+ "
        "--return-code-on-test-failure"
    )
    assert re.search(r"=+ 7 passed in ", "\n".join(printed))


def test_the_program_of_the_page_has_a_route_driven(workspace, tmp_path):
    (tmp_path / "drive.py").write_text(DRIVER.text, "utf-8")
    sourced = ["bash", "-c", f". install/setup.sh && exec python {tmp_path / 'drive.py'}"]
    variables = {**os.environ, **workspace.variables}
    driver = subprocess.Popen(sourced, cwd=workspace.folder, env=variables)
    try:
        told = workspace.run(f"python {HERE / 'follow.py'} 1,2 3.5,-4 5,6")
    finally:
        driver.kill()
        driver.wait(30)
    assert told == ["map", "1,2", "3.5,-4", "5,6"]
