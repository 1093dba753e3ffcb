"""Intel RealSense: cameras of the D4xx and L5xx series, and their recordings as ROS 1 bags."""

from drivers.realsense.bag import RealsenseBag
from drivers.realsense.opening import discover, open_device

__all__ = ["discover", "open_device", "open_recording"]

open_recording = RealsenseBag
