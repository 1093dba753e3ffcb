"""Hand and forearm that cross the view and occlude part of the tracked surface."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.pose import Pose
from drivers.simulated.scene.body import RayImage, Surface
from drivers.simulated.shapes.capsules import cast_capsules, shadowed_by_capsules

#: The hand's joints [m]: x towards the thumb, y from the fingers to the forearm, z towards the occluded surface.
_WRIST, _ELBOW = (0.0, 0.065, 0.0), (0.0, 0.60, 0.0)
_CARPUS = ((-0.018, 0.050, 0.0), (-0.006, 0.045, 0.0), (0.007, 0.045, 0.0), (0.019, 0.050, 0.0))
_KNUCKLES = ((-0.036, -0.032, 0.0), (-0.013, -0.043, 0.0), (0.011, -0.045, 0.0), (0.034, -0.037, 0.0))
_FINGERS = ((-0.058, -0.085, 0.012), (-0.020, -0.122, 0.015), (0.014, -0.130, 0.015), (0.048, -0.112, 0.012))
_THUMB = ((0.024, 0.030, 0.0), (0.058, 0.000, 0.005), (0.078, -0.032, 0.010))
#: Radii of palm, fingers, thumb, wrist and forearm [m].
_PALM, _FINGER, _THICK, _NARROW, _WIDE = 0.014, 0.0085, 0.011, 0.026, 0.034

#: Red, green, blue and infra-red reflectivity of skin.
_SKIN = (0.78, 0.57, 0.47, 0.55)


def _bones() -> NDArray[np.float64]:
    """Capsules (n, 7) in the hand's frame: first end, vector to the other end, radius [m]."""
    ends = [(_WRIST, (0.0, 0.13, 0.0), _NARROW), ((0.0, 0.13, 0.0), _ELBOW, _WIDE)]
    ends += [(carpus, knuckle, _PALM) for carpus, knuckle in zip(_CARPUS, _KNUCKLES)]
    ends += [(knuckle, tip, _FINGER) for knuckle, tip in zip(_KNUCKLES, _FINGERS)]
    ends += [(_THUMB[0], _THUMB[1], _PALM), (_THUMB[1], _THUMB[2], _THICK)]
    return np.array([[*first, *np.subtract(other, first), radius] for first, other, radius in ends])


@dataclass(frozen=True, eq=False)
class Hand:
    """A hand that moves back and forth across the view, fingers up, with the forearm below.

    It keeps a distance from the surfaces. It is out of view during the first second and between two passes. In the
    middle of a pass it occludes about a quarter of a sheet of 0.30 × 0.20 m from the rig's origin.

    Attributes:
        seed: random seed of direction, duration, height and slant of the passes.
        surfaces: the surfaces that it crosses without contact.
        speed: factor on the speed; 0 keeps it out of view.
    """

    seed: int
    surfaces: tuple[Surface, ...]
    speed: float = 1.0

    #: Position out of view, from the middle [m]; start of the motion [s].
    AWAY, FIRST_S = 0.72, 1.0

    #: Distance of its centre below that of the surfaces, and in front of their nearest point [m].
    BELOW, CLEARANCE = 0.073, 0.095

    def at(self, t: float) -> "PlacedHand":
        """The hand at time `t` [s] after the start."""
        side, period_s, height, slant, phase = self._path
        angle = 2 * np.pi * self.speed * max(t - self.FIRST_S, 0.0) / period_s
        covered = np.concatenate([surface.at(t).grid(5, 7).reshape(-1, 3) for surface in self.surfaces])
        position = (
            side * self.AWAY * np.cos(angle),
            covered[:, 1].mean() + self.BELOW + height + 0.005 * np.sin(3 * angle + phase),
            covered[:, 2].min() - self.CLEARANCE + 0.01 * np.sin(2 * angle + phase),
        )
        return PlacedHand(pose.from_rotation_vector((0, 0, slant + 0.05 * np.sin(2 * angle + phase)), position))

    def crossings(self, count: int) -> list[float]:
        """Times [s] of the middle of its first passes."""
        period_s = self._path[1] / self.speed
        return [self.FIRST_S + period_s * (0.25 + 0.5 * i) for i in range(count)]

    @cached_property
    def _path(self) -> tuple[float, float, float, float, float]:
        """Initial side, period [s], height [m], slant [rad], phase of its small motions [rad]."""
        generator = np.random.default_rng([self.seed, 4])
        side = 1.0 if generator.random() < 0.5 else -1.0
        low, high = (13.0, -0.008, -0.12, 0.0), (15.0, 0.008, 0.12, 2 * np.pi)
        period_s, height, slant, phase = generator.uniform(low, high).tolist()
        return side, period_s, height, slant, phase


@dataclass(frozen=True, eq=False)
class PlacedHand:
    """The hand at one moment; see `drivers.simulated.scene.body.Body`.

    Attributes:
        T_rh: pose of the hand.
    """

    T_rh: Pose

    def outline(self) -> NDArray[np.float64]:
        """See `Body.outline`: corners of boxes around both ends of every capsule."""
        capsules = self._capsules(self.T_rh)
        corners = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), axis=-1).reshape(-1, 3)
        ends = np.stack([capsules[:, :3], capsules[:, :3] + capsules[:, 3:6]], axis=1)
        return ends[:, :, None] + corners * capsules[:, None, None, 6:]

    def cast(self, rays: NDArray[np.float64], T_rs: Pose) -> RayImage:
        """See `Body.cast`."""
        share, distance, cosine, part = cast_capsules(rays, self._capsules(pose.inverse(T_rs) @ self.T_rh))
        albedo = np.where((part >= 0)[..., None], np.array(_SKIN, np.float32), np.float32(0))
        return RayImage(share, distance, cosine, albedo)

    def shadowed(self, points_s: NDArray[np.float64], light_s: NDArray[np.float64], T_rs: Pose) -> NDArray[np.bool_]:
        """See `Body.shadowed`."""
        capsules = self._capsules(pose.inverse(T_rs) @ self.T_rh)
        capsules[:, :3] -= light_s
        return shadowed_by_capsules(np.ascontiguousarray(points_s), light_s, capsules)

    @staticmethod
    def _capsules(T_sh: Pose) -> NDArray[np.float64]:
        """The capsules (n, 7) in another frame."""
        capsules = _BONES.copy()
        capsules[:, :3] = pose.transform(T_sh, _BONES[:, :3])
        capsules[:, 3:6] = _BONES[:, 3:6] @ T_sh[:3, :3].T
        return capsules


_BONES = _bones()
