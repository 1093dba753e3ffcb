"""Azure Kinect: the camera, through Microsoft's SDK, and recordings that `k4arecorder` wrote, without it."""

from drivers.azure.address import parse
from drivers.azure.mkv import AzureRecording
from drivers.azure.opening import discover, open_device

__all__ = ["check_address", "discover", "open_device", "open_recording"]

check_address = parse
open_recording = AzureRecording
