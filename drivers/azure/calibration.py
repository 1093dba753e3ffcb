"""The factory calibration of an Azure Kinect: JSON inside each of its recordings.

Source: Azure Kinect Sensor SDK, src/transformation (MIT). Camera matrices are in units of the full sensor's width and
height, with the origin at the corner of the first pixel; a mode is a crop of the binned sensor.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib import pose
from calib.camera import Camera
from calib.lenses.lens import Lens


class CalibrationError(ValueError):
    """A malformed or unsupported calibration."""


@dataclass(frozen=True, slots=True)
class Mode:
    """Region of the sensor that an image covers.

    Attributes:
        binned: width and height of the binned sensor [px].
        offset: of the image's first pixel in the binned sensor [px].
        size: of the image [px].
    """

    binned: tuple[int, int]
    offset: tuple[int, int]
    size: tuple[int, int]


#: Modes of the depth sensor and of colours, in the order of the SDK's numbers, which begin with 1.
DEPTH_MODES: Mapping[str, Mode] = {
    "NFOV_2X2BINNED": Mode((512, 512), (96, 90), (320, 288)),
    "NFOV_UNBINNED": Mode((1024, 1024), (192, 180), (640, 576)),
    "WFOV_2X2BINNED": Mode((512, 512), (0, 0), (512, 512)),
    "WFOV_UNBINNED": Mode((1024, 1024), (0, 0), (1024, 1024)),
    "PASSIVE_IR": Mode((1024, 1024), (0, 0), (1024, 1024)),
}
COLOR_MODES: Mapping[str, Mode] = {
    "720P": Mode((1280, 960), (0, 120), (1280, 720)),
    "1080P": Mode((1920, 1440), (0, 180), (1920, 1080)),
    "1440P": Mode((2560, 1920), (0, 240), (2560, 1440)),
    "1536P": Mode((2048, 1536), (0, 0), (2048, 1536)),
    "2160P": Mode((3840, 2880), (0, 360), (3840, 2160)),
    "3072P": Mode((4096, 3072), (0, 0), (4096, 3072)),
}

_MODES = {"depth": DEPTH_MODES, "color": COLOR_MODES}
_LOCATIONS = {"depth": "D0", "color": "PV0"}

#: The only lens model in factory calibrations: OpenCV's rational model. Rational6KT has half of its p1 and p2.
_MODEL = "CALIBRATION_LensDistortionModelBrownConrady"


def cameras(content: bytes, modes: Mapping[str, str]) -> dict[str, Camera]:
    """Cameras `depth`, which is the rig's frame, and `color`, for the given modes.

    Args:
        content: the JSON.
        modes: by camera; without the encoding for colour, such as `720P`.

    Raises:
        CalibrationError: malformed JSON, or an unknown mode.
    """
    try:
        listed = json.loads(content.rstrip(b"\0"))["CalibrationInformation"]["Cameras"]
        found = {str(entry["Location"]).removeprefix("CALIBRATION_CameraLocation"): entry for entry in listed}
        return {sensor: _camera(sensor, mode, found[_LOCATIONS[sensor]]) for sensor, mode in modes.items()}
    except CalibrationError:
        raise
    except KeyError as error:
        raise CalibrationError(f"the calibration lacks {error}") from error
    except (ValueError, TypeError, RecursionError) as error:
        raise CalibrationError(f"the calibration is not understood: {error}") from error


def _camera(sensor: str, name: str, entry: Mapping[str, Any]) -> Camera:
    modes = _MODES[sensor]
    if name not in modes:
        raise CalibrationError(f"mode {name!r} of {sensor} is none of {sorted(modes)}")
    mode = modes[name]
    intrinsics, extrinsics = entry["Intrinsics"], entry["Rt"]
    if intrinsics["ModelType"] != _MODEL:
        raise CalibrationError(f"{sensor}: lens model {intrinsics['ModelType']!r} is not supported, only {_MODEL!r}")
    cx, cy, fx, fy, k1, k2, k3, k4, k5, k6, u, v, p2, p1 = map(float, intrinsics["ModelParameters"])
    if (u, v) != (0, 0):
        raise CalibrationError(f"{sensor}: the centre of distortion {u, v} must be that of the image")
    (width, height), (left, top) = mode.binned, mode.offset
    # The pose in the file maps depth coordinates to the camera's.
    T_rs = pose.inverse(pose.from_rotation(extrinsics["Rotation"], extrinsics["Translation"]))
    return Camera(
        *mode.size,
        fx * width,
        fy * height,
        cx * width - left - 0.5,
        cy * height - top - 0.5,
        Lens(np.array([k1, k2, p1, p2, k3, k4, k5, k6])),
        T_rs,
    )
