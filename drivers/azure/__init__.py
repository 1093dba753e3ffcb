"""Recordings of the Azure Kinect, as `k4arecorder` writes them."""

from drivers.azure.mkv import AzureRecording

__all__ = ["open_recording"]

open_recording = AzureRecording
