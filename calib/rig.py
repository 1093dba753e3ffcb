"""A rig: named sensors, each with its camera and its noise model."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass

from calib.camera import Camera
from calib.no_return import CAUTIOUS, NoReturn
from calib.noise.base import DepthNoise, ImageNoise
from calib.noise.images.binary import LightBarrier

Noise = DepthNoise | ImageNoise | LightBarrier


@dataclass(frozen=True)
class Sensor:
    """Sensor s of the paper: one kind of measurement of one optical head, with its camera and noise model.

    A head that delivers two kinds, such as a time-of-flight camera with amplitudes, is two sensors with one camera.

    Attributes:
        name: name in the rig: the head's, `tof`; with the stream, `tof/amplitude`, for the second of a head.
        camera: of the head.
        noise: noise model of the measurement; its type determines the kind of measurement.
        outlier_share: fraction of outliers among the measurements, 0…1; None for the objective's default.
        range_m: largest distance that a depth sensor reports [m]; None for the default.
        depth_offset, depth_scale: a depth sensor measures (1 + scale) · distance + offset [1, m]; the noise model is
            about what is left when that is taken off.
        no_return: probability that a depth sensor has no return from a surface.
    """

    name: str
    camera: Camera
    noise: Noise
    outlier_share: float | None = None
    range_m: float | None = None
    depth_offset: float = 0.0
    depth_scale: float = 0.0
    no_return: NoReturn = CAUTIOUS

    @property
    def head(self) -> str:
        """Name of the optical head."""
        return self.name.partition("/")[0]


@dataclass(frozen=True)
class Rig:
    """All sensors of a rig by name, calibrated into one common frame."""

    name: str
    sensors: Mapping[str, Sensor]

    @property
    def calib_id(self) -> str:
        """Short hash of all cameras."""
        cameras = {sensor.head: sensor.camera.calib_id for sensor in self.sensors.values()}
        parts = "".join(f"{name}:{calib_id};" for name, calib_id in sorted(cameras.items()))
        return hashlib.sha256(parts.encode()).hexdigest()[:16]
