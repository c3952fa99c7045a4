import sys
from importlib import import_module
from importlib.util import find_spec
from types import SimpleNamespace

import pytest

from tests.ros import messages, rclpy_stand_in
from tests.tools import ROOT, require

collect_ignore = ["follow.py", "ros2.py"]  # programs for where ROS is
PACKAGE = ROOT / "clients" / "ros" / "sketchmatch_ros"


@pytest.fixture(scope="session")
def ros():
    """Return the package's modules, between stand-ins for ROS's, and what makes messages."""
    require(find_spec("rosbags"), "rosbags, which has ROS's definitions,")
    installed = [*messages.install(), *rclpy_stand_in.install()]
    sys.path.insert(0, str(PACKAGE))
    try:
        names = ("carrying", "conversions", "matching", "node")
        modules = {name: import_module(f"sketchmatch_ros.{name}") for name in names}
        yield SimpleNamespace(**modules)
    finally:
        sys.path.remove(str(PACKAGE))
        for name in installed:
            sys.modules.pop(name, None)
        for name in [name for name in sys.modules if name.partition(".")[0] == "sketchmatch_ros"]:
            del sys.modules[name]
