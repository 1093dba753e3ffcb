"""RGB-D recordings of BundleFusion and ScanNet, files named `.sens`."""

from drivers.sens.recording import SensRecording

__all__ = ["open_recording"]

open_recording = SensRecording
