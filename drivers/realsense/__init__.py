"""Intel RealSense: cameras of the D4xx and L5xx kind, and their recordings as ROS 1 bags."""

from drivers.realsense.bag import RealsenseBag

__all__ = ["open_recording"]

open_recording = RealsenseBag
