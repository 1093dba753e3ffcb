"""Recordings of the Azure Kinect, written by `k4arecorder`."""

from drivers.azure.mkv import AzureRecording

__all__ = ["open_recording"]

open_recording = AzureRecording
