"""Events that break tracking: a surface leaves the view and returns, or rotates abruptly."""

import math
from dataclasses import dataclass

import numpy as np

from calib import pose
from calib.pose import Pose
from drivers.simulated.scene.motion import smooth_step


@dataclass(frozen=True)
class Excursion:
    """Displacement of a surface in addition to its motion.

    Attributes:
        turn_s: start of a permanent rotation by 90° about its normal, clockwise for the viewer [s].
        leave_s: interval in which it is out of view [s]; it moves right just before and returns just after.
    """

    turn_s: float = math.inf
    leave_s: tuple[float, float] = (math.inf, math.inf)

    #: Durations of the rotation and of leaving or returning [s]; displacement out of view [m].
    TURNING_S, LEAVING_S, AWAY = 0.25, 0.4, 1.2

    def displaced(self, T_rp: Pose, t: float) -> Pose:
        """Pose at time `t` [s] of a surface whose own motion gives `T_rp`; z is its normal, away from the viewer."""
        turned = smooth_step((t - self.turn_s) / self.TURNING_S)
        gone = smooth_step(1 + (t - self.leave_s[0]) / self.LEAVING_S)
        back = smooth_step((t - self.leave_s[1]) / self.LEAVING_S)
        if turned > 0:
            T_rp = T_rp @ pose.from_rotation_vector((0, 0, turned * np.pi / 2), (0, 0, 0))
        if gone > back:
            T_rp = pose.from_rotation_vector((0, 0, 0), ((gone - back) * self.AWAY, 0, 0)) @ T_rp
        return T_rp
