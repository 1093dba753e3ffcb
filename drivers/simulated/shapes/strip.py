"""Thin elastic strip, clamped at one end, that sags under its weight."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.pose import Pose
from drivers.simulated.scene.body import RayImage
from drivers.simulated.scene.excursion import Excursion
from drivers.simulated.scene.motion import Oscillation
from drivers.simulated.scene.texture import Texture
from drivers.simulated.shapes.antialiasing import cast_antialiased
from drivers.simulated.shapes.elastica import Profile, solve_elastica
from drivers.simulated.shapes.ribbon import cast_ribbon, shadowed_by_ribbon

#: Acceleration of free fall [m/s²]; it acts along the rig's y axis, which is down in the images.
GRAVITY = 9.81


@dataclass(frozen=True, eq=False)
class Strip:
    """A strip in a gripper that moves, turns about the vertical and tilts, quasi-statically.

    It is at rest during the first second, and always if the speed is 0. The gripper never rolls, so the strip stays in
    a vertical plane and its shape is the solution of `elastica`.

    Attributes:
        seed: of the motion.
        length, width: of the flat strip [m].
        stiffness: bending stiffness per width, E t³ / 12 (1 − ν²) for a plate of thickness t [N·m].
        weight: mass per area [kg/m²].
        texture: its texture, with the x axis along the strip.
        speed: factor on the speed of the motion.
        excursion: displacement in addition to the motion; must not rotate, or gravity would change the shape.
    """

    seed: int
    length: float
    width: float
    stiffness: float
    weight: float
    texture: Texture
    speed: float = 1.0
    excursion: Excursion = field(default_factory=Excursion)

    #: Rest position and maximum displacement of the gripper [m]; mean tilt (between strip and vertical), amplitude of
    #: tilt and of turning [rad].
    REST, REACH = (0.0, -0.13, 1.07), (0.03, 0.02, 0.03)
    TILT, TILTING, TURNING = np.deg2rad(55), np.deg2rad(15), np.deg2rad(20)

    def at(self, t: float) -> "PlacedStrip":
        """The strip at time `t` [s] after the start."""
        channels = self._oscillation.at(t)
        position = np.array(self.REST) + np.array(self.REACH) * channels[0:3]
        # At rest the strip leaves the gripper towards the viewer and down: the profile's x axis is the rig's −z.
        T_rp = pose.from_rotation_vector((0, np.pi / 2 + self.TURNING * channels[4], 0), position)
        load = self.weight * GRAVITY / self.stiffness
        profile = solve_elastica(self.length, load, float(self.TILT + self.TILTING * channels[3]))
        return PlacedStrip(self.width, self.texture, self.excursion.displaced(T_rp, t), profile)

    @cached_property
    def _oscillation(self) -> Oscillation:
        return Oscillation(self.seed, self.speed)


@dataclass(frozen=True, eq=False)
class PlacedStrip:
    """The strip at one moment; see `drivers.simulated.scene.body.SurfaceBody`.

    Attributes:
        width: of the strip [m].
        texture: its texture.
        T_rp: pose of the profile: origin in the middle of the clamp, x horizontally away from it, y down, z across.
        profile: the shape.
    """

    width: float
    texture: Texture
    T_rp: Pose
    profile: Profile

    @property
    def T_rg(self) -> Pose:
        """Pose of the gripper: origin in the middle of the clamp, x along the clamped end of the strip, y across."""
        sine, cosine = np.sin(self.profile.angle[0]), np.cos(self.profile.angle[0])
        T_pg = pose.identity()
        T_pg[:3, :3] = np.array([[sine, 0.0, cosine], [cosine, 0.0, -sine], [0.0, 1.0, 0.0]])
        return self.T_rp @ T_pg

    def grid(self, rows: int, columns: int) -> NDArray[np.float64]:
        """See `SurfaceBody.grid`; columns go from the clamp to the free end."""
        s = np.linspace(0, self.profile.s[-1], columns)
        reach, drop = (np.interp(s, self.profile.s, values) for values in (self.profile.reach, self.profile.drop))
        across = np.linspace(-self.width / 2, self.width / 2, rows)[:, None]
        points_p = np.stack(np.broadcast_arrays(reach, drop, across), axis=-1)
        return pose.transform(self.T_rp, points_p)

    def outline(self) -> NDArray[np.float64]:
        """See `Body.outline`."""
        return self.grid(2, 33)

    def cast(self, rays: NDArray[np.float64], T_rs: Pose) -> RayImage:
        """See `Body.cast`."""
        T_ps, nodes = self._into_profile(T_rs), self._nodes()
        sight, share = cast_antialiased(lambda rays_s: cast_ribbon(rays_s, T_ps, nodes, self.width / 2), rays)
        distance, place, across, cosine = sight
        chord = np.float32(self.profile.s[1])
        along = place * chord - np.float32(self.profile.s[-1] / 2)
        return RayImage(share, distance, cosine, self.texture.at(along, across))

    def shadowed(self, points_s: NDArray[np.float64], light_s: NDArray[np.float64], T_rs: Pose) -> NDArray[np.bool_]:
        """See `Body.shadowed`."""
        T_ps = self._into_profile(T_rs)
        points_p, light_p = pose.transform(T_ps, points_s), pose.transform(T_ps, light_s)
        return shadowed_by_ribbon(points_p, light_p, self._nodes(), self.width / 2)

    def _into_profile(self, T_rs: Pose) -> Pose:
        return np.ascontiguousarray(pose.inverse(self.T_rp) @ T_rs)

    def _nodes(self) -> NDArray[np.float64]:
        """Kernel parameters: nodes of the curve, (n, 4)."""
        angle = self.profile.angle
        return np.stack([self.profile.reach, self.profile.drop, np.sin(angle), np.cos(angle)], axis=1)
