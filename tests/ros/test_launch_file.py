"""The launch file, run between stand-ins for launch, of which there is no wheel."""

import runpy
import sys
from types import ModuleType, SimpleNamespace

from tests.ros.conftest import PACKAGE

NAME = "sketchmatch_ros"


class Recorded(SimpleNamespace):
    """Any part of a description of what is launched, as it was made."""


def recording(name):
    return type(
        name,
        (Recorded,),
        {"__init__": lambda self, *given, **named: self.__dict__.update(named, given=given)},
    )


def test_the_launch_file_starts_what_setup_installs_and_makes_it_active(ros, monkeypatch, tmp_path):
    del ros
    modules = {
        "ament_index_python.packages": ["get_package_share_directory"],
        "launch": ["LaunchDescription"],
        "launch.actions": ["DeclareLaunchArgument", "EmitEvent", "RegisterEventHandler"],
        "launch.conditions": ["IfCondition"],
        "launch.events": ["matches_action"],
        "launch.substitutions": ["LaunchConfiguration"],
        "launch_ros.actions": ["LifecycleNode", "Node"],
        "launch_ros.event_handlers": ["OnStateTransition"],
        "launch_ros.events.lifecycle": ["ChangeState"],
    }
    for module, names in modules.items():
        stand_in = ModuleType(module)
        stand_in.__dict__.update({name: recording(name) for name in names})
        monkeypatch.setitem(sys.modules, module, stand_in)
    shared = sys.modules["ament_index_python.packages"]
    shared.get_package_share_directory = lambda package: PACKAGE if package == NAME else tmp_path

    file = runpy.run_path(str(PACKAGE / "launch" / "sketchmatch.launch.py"))
    (parts,) = file["generate_launch_description"]().given
    kinds = [type(part).__name__ for part in parts]
    # What waits for the node's state is there before the node is.
    assert kinds.index("RegisterEventHandler") < kinds.index("LifecycleNode")
    arguments = {part.given[0]: part.default_value for part in parts[:2]}
    assert (PACKAGE / "config" / "sketchmatch.yaml").samefile(arguments["params_file"])
    assert arguments["rviz"] == "false"
    handler, node, change, rviz = parts[2:]
    assert f'"console_scripts": [f"{node.executable} = ' in (PACKAGE / "setup.py").read_text(
        "utf-8"
    )
    assert (node.package, node.name) == (NAME, "sketchmatch")
    assert node.parameters[0].given == ("params_file",)
    assert (change.event.transition_id, change.event.lifecycle_node_matcher.given) == (1, (node,))
    (waits,) = handler.given
    assert (waits.target_lifecycle_node, waits.goal_state) == (node, "inactive")
    (then,) = waits.entities
    assert (then.event.transition_id, then.event.lifecycle_node_matcher.given) == (3, (node,))
    assert rviz.condition.given[0].given == ("rviz",)
    assert (PACKAGE / "rviz" / "sketchmatch.rviz").samefile(rviz.arguments[1])
