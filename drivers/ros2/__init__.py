"""Bags of ROS 2, in MCAP or SQLite files: depth and colour images of any camera's ROS driver, without ROS."""

from drivers.ros2.bag import Ros2Bag

__all__ = ["open_recording"]

open_recording = Ros2Bag
