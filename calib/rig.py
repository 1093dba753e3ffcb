"""A rig: named sensors, each with its camera and its noise model."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass

from calib.camera import Camera
from calib.noise.base import DepthNoise
from calib.noise.bayer import GaussianBayer
from calib.noise.binary import LightBarrier
from calib.noise.color import GaussianColor
from calib.noise.grey import GaussianGrey
from calib.noise.intensity import GaussianIntensity

#: Noise models of what an image shows of a surface, and no length.
PictureNoise = GaussianColor | GaussianGrey | GaussianBayer | GaussianIntensity
Noise = DepthNoise | PictureNoise | LightBarrier


@dataclass(frozen=True)
class Sensor:
    """A sensor s of the paper, one kind of measurement of one optical head: where it is, how it projects, how it errs.

    A head that delivers two, such as a time-of-flight camera with its amplitudes, is two sensors with one camera.

    Attributes:
        name: name in the rig: that of the head, `tof`, with the stream, `tof/amplitude`, if it is the head's second.
        camera: projection `P_s`.
        noise: noise model of what it measures, and so what that is.
        outlier_share: share of its measurements that come from anywhere, 0…1; None if nobody knows better than the
            objective.
        range_m: distances that it can report at all, if it is a depth sensor [m]; None likewise.
        depth_offset, depth_scale: a depth sensor measures (1 + scale) · distance + offset [1, m]; the noise model is
            about what is left when that is taken off.
    """

    name: str
    camera: Camera
    noise: Noise
    outlier_share: float | None = None
    range_m: float | None = None
    depth_offset: float = 0.0
    depth_scale: float = 0.0

    @property
    def head(self) -> str:
        """Name of the optical head."""
        return self.name.partition("/")[0]


@dataclass(frozen=True)
class Rig:
    """All sensors that look at the scene, by name, calibrated into one common frame."""

    name: str
    sensors: Mapping[str, Sensor]

    @property
    def calib_id(self) -> str:
        """Short hash of all cameras; changes whenever one of them does."""
        cameras = {sensor.head: sensor.camera.calib_id for sensor in self.sensors.values()}
        parts = "".join(f"{name}:{calib_id};" for name, calib_id in sorted(cameras.items()))
        return hashlib.sha256(parts.encode()).hexdigest()[:16]
