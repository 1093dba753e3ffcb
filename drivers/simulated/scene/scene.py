"""A scene: surfaces to track, what may hide them, and the wall behind everything."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.pose import Pose
from drivers.simulated.scene.body import Body, MovingBody, Surface, SurfaceBody
from drivers.simulated.scene.texture import Texture

#: Distance of a surface at rest, and of the wall behind it, along the rig's z axis [m].
REST_Z, WALL_Z = 1.0, 1.6


@dataclass(frozen=True, eq=False)
class Moment:
    """What is where at one moment.

    Attributes:
        surfaces: what is to be tracked.
        occluders: what is in front of it.
    """

    surfaces: tuple[SurfaceBody, ...]
    occluders: tuple[Body, ...] = ()

    @property
    def bodies(self) -> tuple[Body, ...]:
        """All bodies; whatever hides another comes after it."""
        return (*self.surfaces, *self.occluders)

    def hidden(self, points_r: NDArray[np.float64], eye_r: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which of some rig points (rows, columns, 3) [m] a body keeps from an eye at `eye_r` (3,) [m].

        A point on a surface is hidden by the surface's other parts as by everything else. Whether it lies in an image
        is another question.
        """
        hidden = np.zeros(points_r.shape[:-1], np.bool_)
        for body in self.bodies:
            hidden |= body.shadowed(points_r, eye_r, pose.identity())
        return hidden


@dataclass(frozen=True, eq=False)
class Scene:
    """Things that move before a wall.

    Attributes:
        surfaces: what is to be tracked; none ever hides another.
        wall: texture of the wall, centred on the rig's z axis.
        occluders: what is always in front of the surfaces.
        T_rw: pose of the wall: its plane is z = 0 of frame w; by default z = `WALL_Z` of the rig.
    """

    surfaces: tuple[Surface, ...]
    wall: Texture
    occluders: tuple[MovingBody, ...] = ()
    T_rw: Pose = field(default_factory=lambda: pose.from_rotation_vector((0, 0, 0), (0, 0, WALL_Z)))

    def at(self, t: float) -> Moment:
        """Where everything is at time `t` [s] after the start."""
        return Moment(tuple(surface.at(t) for surface in self.surfaces), tuple(thing.at(t) for thing in self.occluders))
