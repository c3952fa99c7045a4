"""Starts the node, and makes it active; nav2's lifecycle manager can do that instead."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, EmitEvent, RegisterEventHandler
from launch.conditions import IfCondition
from launch.events import matches_action
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode, Node
from launch_ros.event_handlers import OnStateTransition
from launch_ros.events.lifecycle import ChangeState
from lifecycle_msgs.msg import Transition

from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Return the node, its two transitions, and RViz where it is asked for."""
    share = Path(get_package_share_directory("sketchmatch_ros"))
    node = LifecycleNode(
        package="sketchmatch_ros",
        executable="sketchmatch",
        name="sketchmatch",
        namespace="",
        parameters=[LaunchConfiguration("params_file")],
        output="screen",
    )

    def change(transition: int) -> EmitEvent:
        return EmitEvent(
            event=ChangeState(lifecycle_node_matcher=matches_action(node), transition_id=transition)
        )

    once_configured = OnStateTransition(
        target_lifecycle_node=node,
        start_state="configuring",
        goal_state="inactive",
        entities=[change(Transition.TRANSITION_ACTIVATE)],
    )
    rviz = Node(
        package="rviz2",
        executable="rviz2",
        arguments=["-d", str(share / "rviz" / "sketchmatch.rviz")],
        condition=IfCondition(LaunchConfiguration("rviz")),
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "params_file", default_value=str(share / "config" / "sketchmatch.yaml")
            ),
            DeclareLaunchArgument("rviz", default_value="false"),
            RegisterEventHandler(once_configured),
            node,
            change(Transition.TRANSITION_CONFIGURE),
            rviz,
        ]
    )
