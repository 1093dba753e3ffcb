"""Factory calibration of depth: the reference plane of the projected pattern."""

import math
import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.camera import Camera
from drivers.contract.device import DeviceError

#: The raw value that means no return; raw values are numbers of 11 bits.
NO_RETURN, RAW_VALUES = 2047, 2048

#: Quantisation step of a depth image [m]. Neighbouring raw values are at least 0.29 mm apart, so the conversion is
#: lossless. 16 bits reach 13.1 m; the device is specified for 0.8 to 4 m.
DEPTH_SCALE = 0.0002

#: Focal length of the colour camera per image width: 525 px of 640, for its field of view of 62.7°.
COLOR_FOCAL_RATIO = 525 / 640

_PLANE_OFFSET = 94  # of four floats in the answer to the command for fixed parameters


class CalibrationError(DeviceError):
    """An invalid calibration of the device."""


@dataclass(frozen=True)
class ReferencePlane:
    """Parameters of the conversion from raw disparity to depth.

    Attributes:
        baseline: from the infra-red camera to the projector [m].
        color_baseline: from the infra-red camera to the colour camera, in the same direction [m].
        distance: of the plane [m].
        pixel: unit of disparity in the image of the plane: twice a pixel of an image of 640 px [m].
        shift: raw value of the plane, divided by 4.
    """

    baseline: float = 0.075
    color_baseline: float = 0.023
    distance: float = 1.2
    pixel: float = 0.001042
    shift: int = 200

    def z(self) -> NDArray[np.float64]:
        """Distance along the optical axis of every raw value (2048,) [m]; NaN for no return or beyond infinity.

        With the disparity on the plane m = ((raw − 4 shift) / 4 − 3/8) · pixel, it is distance · baseline /
        (baseline − m).
        """
        raw = np.arange(RAW_VALUES)
        away = self.baseline - ((raw - 4 * self.shift) / 4 - 0.375) * self.pixel
        z = np.full(RAW_VALUES, np.nan)
        seen = (away > 0) & (raw != NO_RETURN)
        z[seen] = self.distance * self.baseline / away[seen]
        return z

    def table(self) -> NDArray[np.uint16]:
        """Depth of every raw value (2048,) in units of `DEPTH_SCALE`; 0 for no return."""
        steps = np.rint(self.z() / DEPTH_SCALE)
        return np.where((steps >= 1) & (steps <= 65535), steps, 0).astype("<u2")

    @property
    def step(self) -> float:
        """Quantisation step of 1/z [1/m]; the `step` of the noise model."""
        return self.pixel / (4 * self.distance * self.baseline)

    def depth_camera(self, height: int = 480) -> Camera:
        """The infra-red camera, which is the depth camera; nominal except for its focal length."""
        focal = self.distance / (2 * self.pixel)
        return Camera(640, height, focal, focal, 319.5, (height - 1) / 2)

    def color_camera(self) -> Camera:
        """The colour camera, nominal; its pose is the lens distance that the device reports."""
        focal = COLOR_FOCAL_RATIO * 640
        T_rs = pose.from_rotation_vector((0, 0, 0), (self.color_baseline, 0, 0))
        return Camera(640, 480, focal, focal, 319.5, 239.5, T_rs=T_rs)


def parse(fixed: bytes, shift: bytes) -> ReferencePlane:
    """Parses the answers to the commands for fixed parameters and for the constant shift.

    Raises:
        CalibrationError: too short, or numbers that describe no plane.
    """
    if len(fixed) < _PLANE_OFFSET + 16 or len(shift) < 4:
        raise CalibrationError(
            f"the camera's calibration has {len(fixed)} and {len(shift)} bytes, at least 110 and 4 are needed"
        )
    centimetres = struct.unpack_from("<4f", fixed, _PLANE_OFFSET)
    (quarters,) = struct.unpack_from("<H", shift, 2)
    baseline, color_baseline, distance, pixel = (0.01 * number for number in centimetres)
    plausible = 0.01 < baseline < 1 and 0 <= abs(color_baseline) < 1 and 0.1 < distance < 10 and 1e-4 < pixel < 0.1
    if not (plausible and all(map(math.isfinite, centimetres)) and 0 < quarters < RAW_VALUES):
        raise CalibrationError(
            f"the camera's calibration is none: baselines, distance and pixel {centimetres} cm, shift {quarters}; "
            "a device usually says about 7.5, 2.3, 120 and 0.1 cm, and 200"
        )
    return ReferencePlane(baseline, color_baseline, distance, pixel, quarters)
