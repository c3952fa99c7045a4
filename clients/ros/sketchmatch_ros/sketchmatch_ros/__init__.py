"""Matches sketches with the robot's map, as a ROS 2 lifecycle node.

:mod:`~sketchmatch_ros.conversions` turns messages into what the client sends and back,
:mod:`~sketchmatch_ros.matching` asks the server and may be told to stop, both without rclpy;
:mod:`~sketchmatch_ros.node` gives them topics, an action and a life.
"""
