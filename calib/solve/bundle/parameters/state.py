"""Values determined by a calibration, during or after the optimisation."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.pose import Pose


@dataclass(frozen=True, slots=True)
class SensorState:
    """State of one optical head.

    Attributes:
        camera: projection with its pose in the rig.
        depth_offset, depth_scale: measured distance = (1 + scale) · distance + offset [m, 1].
        time_offset: offset from the sensor's clock to the rig's [s]; added to the sensor's times.
    """

    camera: Camera
    depth_offset: float = 0.0
    depth_scale: float = 0.0
    time_offset: float = 0.0

    def predicted_distances(self, T_sb: Pose, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
        """Radial distances (n,) [m] that the sensor measures of a board's plane z = 0 at pixels (n, 2)."""
        normal = T_sb[:3, 2]
        distances = (normal @ T_sb[:3, 3]) / (self.camera.directions(pixels) @ normal)
        return np.asarray((1 + self.depth_scale) * distances + self.depth_offset, np.float64)


@dataclass(frozen=True, slots=True)
class State:
    """All heads by name, and the board poses `T_rb` by number of the shot."""

    sensors: Mapping[str, SensorState]
    boards: Mapping[int, Pose]
