"""Everything that a calibration determines, at one moment of the search or at its end."""

from collections.abc import Mapping
from dataclasses import dataclass

from calib.camera import Camera
from calib.pose import Pose


@dataclass(frozen=True, slots=True)
class SensorState:
    """One optical head.

    Attributes:
        camera: projection with its pose in the rig.
        depth_offset, depth_scale: measured distance = (1 + scale) · distance + offset [m, 1].
        time_offset: what has to be added to the sensor's times to get the rig's [s].
    """

    camera: Camera
    depth_offset: float = 0.0
    depth_scale: float = 0.0
    time_offset: float = 0.0


@dataclass(frozen=True, slots=True)
class State:
    """All heads by name, and the poses `T_rb` of the board by number of the shot."""

    sensors: Mapping[str, SensorState]
    boards: Mapping[int, Pose]
