"""Motion of a hand-held calibration board: held still in a pose, moved to the next, held still again."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from calib import pose
from calib.pose import Pose
from drivers.simulated.scene.motion import Placement, smooth_step

#: Duration of the move from one pose to the next [s].
MOVE_S = 1.0
#: Range of distances from the rig's origin [m], and maximum tilt and roll [rad].
MIN_DISTANCE_M, MAX_DISTANCE_M = 0.55, 0.95
TILT, ROLL = np.deg2rad(40), np.deg2rad(20)
#: Half width and height of the time-of-flight head's view at 1 m, less a margin [m].
_SEEN = (0.37, 0.29)


@dataclass(frozen=True)
class BoardMotion:
    """Motion of a flat board; see `drivers.simulated.scene.motion.Motion`.

    The first pose faces the rig from 0.7 m. The others are random: tilted by up to 40° about an axis in the board's
    plane, rolled by up to 20°, and for `reach` 1 inside the view of the time-of-flight head when fronto-parallel.

    Attributes:
        seed: random seed of the poses.
        width, height: of the board [m].
        hold_s: duration of each pose [s].
        reach: lateral range of the poses; 1 is the field of view of the time-of-flight head.
        speed: factor on time; with 0 the board stays in its first pose.
    """

    seed: int
    width: float
    height: float
    hold_s: float = 1.0
    reach: float = 1.0
    speed: float = 1.0

    def at(self, t: float) -> Placement:
        """The placement at time `t` [s] after the start."""
        number, since = divmod(max(t * self.speed, 0.0), self.hold_s + MOVE_S)
        part = smooth_step((since - self.hold_s) / MOVE_S)
        return Placement(_between(self.pose_at(int(number)), self.pose_at(int(number) + 1), part))

    def pose_at(self, number: int) -> Pose:
        """Pose `T_rp` of the board's centre after `number` moves."""
        return _held(self, number)


@lru_cache(maxsize=256)
def _held(board_motion: BoardMotion, number: int) -> Pose:
    if number == 0:
        return pose.from_rotation_vector((0, 0, 0), (0, 0, 0.7))
    generator = np.random.default_rng([board_motion.seed, 5, number])
    distance = generator.uniform(MIN_DISTANCE_M, MAX_DISTANCE_M)
    axis, angle = generator.uniform(0, 2 * np.pi), TILT * np.sqrt(generator.uniform(0.05, 1))
    roll = Rotation.from_rotvec([0, 0, generator.uniform(-ROLL, ROLL)])
    turned = Rotation.from_rotvec(angle * np.array([np.cos(axis), np.sin(axis), 0])) * roll
    room = board_motion.reach * np.array(_SEEN) * distance - 0.5 * np.array([board_motion.width, board_motion.height])
    x, y = np.maximum(room, 0) * generator.uniform(-1, 1, 2)
    return pose.from_rotation_vector(turned.as_rotvec(), (x, y, distance))


def _between(first: Pose, second: Pose, part: float) -> Pose:
    """Interpolated pose, `part` from 0 to 1: linear translation, rotation about one axis."""
    turn = Rotation.from_matrix(second[:3, :3] @ first[:3, :3].T).as_rotvec()
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(part * turn).as_matrix() @ first[:3, :3]
    T[:3, 3] = (1 - part) * first[:3, 3] + part * second[:3, 3]
    return T
