"""Events that a tracker cannot follow: something leaves the view and comes back, or turns at once."""

import math
from dataclasses import dataclass

import numpy as np

from calib import pose
from calib.pose import Pose
from drivers.simulated.scene.motion import smooth_step


@dataclass(frozen=True)
class Excursion:
    """What happens to a thing on top of its motion.

    Attributes:
        turn_s: when it begins to turn by 90° about its own normal, clockwise for the viewer; it stays turned [s].
        leave_s: from when until when it is out of view [s]; it goes to the right just before and returns just after.
    """

    turn_s: float = math.inf
    leave_s: tuple[float, float] = (math.inf, math.inf)

    #: How long the turn, the leaving and the returning take [s]; how far away out of view is [m].
    TURNING_S, LEAVING_S, AWAY = 0.25, 0.4, 1.2

    def displaced(self, T_rp: Pose, t: float) -> Pose:
        """The pose at time `t` [s] of a thing that would be at `T_rp`, where z is its normal, away from the viewer."""
        turned = smooth_step((t - self.turn_s) / self.TURNING_S)
        gone = smooth_step(1 + (t - self.leave_s[0]) / self.LEAVING_S)
        back = smooth_step((t - self.leave_s[1]) / self.LEAVING_S)
        if turned > 0:
            T_rp = T_rp @ pose.from_rotation_vector((0, 0, turned * np.pi / 2), (0, 0, 0))
        if gone > back:
            T_rp = pose.from_rotation_vector((0, 0, 0), ((gone - back) * self.AWAY, 0, 0)) @ T_rp
        return T_rp
