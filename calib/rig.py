"""A rig: named sensors, each with its camera and its noise model."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass

from calib.camera import Camera
from calib.noise.base import DepthNoise
from calib.noise.color import GaussianColor


@dataclass(frozen=True)
class Sensor:
    """One optical head: where it is, how it projects and how it errs.

    Attributes:
        name: name in the rig.
        camera: projection `P_s`.
        noise: noise model of its distances, or of its colours.
        outlier_share: share of its measurements that come from anywhere, 0…1; None if nobody knows better than the
            objective.
        range_m: distances that it can report at all, if it is a depth sensor [m]; None likewise.
    """

    name: str
    camera: Camera
    noise: DepthNoise | GaussianColor
    outlier_share: float | None = None
    range_m: float | None = None


@dataclass(frozen=True)
class Rig:
    """All sensors that look at the scene, by name, calibrated into one common frame."""

    name: str
    sensors: Mapping[str, Sensor]

    @property
    def calib_id(self) -> str:
        """Short hash of all cameras; changes whenever one of them does."""
        parts = "".join(f"{name}:{sensor.camera.calib_id};" for name, sensor in sorted(self.sensors.items()))
        return hashlib.sha256(parts.encode()).hexdigest()[:16]
