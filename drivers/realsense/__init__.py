"""Intel RealSense: cameras of the D4xx and L5xx series, and their recordings as ROS 1 bags."""

from drivers.realsense.address import parse
from drivers.realsense.bag import RealsenseBag
from drivers.realsense.opening import discover, open_device

__all__ = ["check_address", "discover", "open_device", "open_recording"]

check_address = parse
open_recording = RealsenseBag
