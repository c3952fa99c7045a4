"""A controller as nav2's seems from outside: it says which path it is to follow, and has done so.

A route is published for whoever drives it, latched as the node of ours publishes it.
"""

import sys

import rclpy
from geometry_msgs.msg import PoseStamped
from nav2_msgs.action import FollowPath
from nav_msgs.msg import Path
from rclpy.action import ActionServer
from rclpy.qos import DurabilityPolicy, QoSProfile


def main(*places: str) -> None:
    rclpy.init()
    node = rclpy.create_node("controller")
    driven = []

    def follow(goal):
        driven.append(goal.request.path)
        goal.succeed()
        return FollowPath.Result()

    server = ActionServer(node, FollowPath, "follow_path", follow)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    route = Path()
    route.header.frame_id = "map"
    for place in places:
        pose = PoseStamped()
        pose.pose.position.x, pose.pose.position.y = map(float, place.split(","))
        route.poses.append(pose)
    node.create_publisher(Path, "/sketchmatch/route", latched).publish(route)
    while not driven:
        rclpy.spin_once(node)
    print(driven[0].header.frame_id)
    for pose in driven[0].poses:
        print(f"{pose.pose.position.x:g},{pose.pose.position.y:g}")
    server.destroy()
    rclpy.try_shutdown()


main(*sys.argv[1:])
