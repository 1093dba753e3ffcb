"""The public face of the package, for programs that have arrays and no running service; `abs_service` re-exports it."""

from abs_service.api import noise
from abs_service.api.checks import ArgumentError
from abs_service.api.estimate import Estimate
from abs_service.api.models import FlexPad, Gravity, Nurbs, Posed, Rigid
from abs_service.api.recording import Image, Recording, open_recording
from abs_service.api.rig import Rig, load_rig
from abs_service.api.tracker import Tracker
from abs_service.config import ConfigError
from abs_service.tracker.estimates.estimate import Status
from calib.camera import Camera, CameraError
from calib.lenses.fisheye import KannalaBrandt as Fisheye
from calib.lenses.lens import Lens, LensError
from drivers.replay import RecordingError

__all__ = [
    "ArgumentError",
    "Camera",
    "CameraError",
    "ConfigError",
    "Estimate",
    "Fisheye",
    "FlexPad",
    "Gravity",
    "Image",
    "Lens",
    "LensError",
    "Nurbs",
    "Posed",
    "Recording",
    "RecordingError",
    "Rig",
    "Rigid",
    "Status",
    "Tracker",
    "load_rig",
    "noise",
    "open_recording",
]
