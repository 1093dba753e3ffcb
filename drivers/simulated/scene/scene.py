"""Scene: surfaces to track, occluders, and a wall behind them."""

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
    """All bodies at one moment."""

    surfaces: tuple[SurfaceBody, ...]
    occluders: tuple[Body, ...] = ()

    @property
    def bodies(self) -> tuple[Body, ...]:
        """All bodies, occluding ones after occluded ones."""
        return (*self.surfaces, *self.occluders)

    def hidden(self, points_r: NDArray[np.float64], eye_r: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Occlusion mask of rig points (rows, columns, 3) [m] seen from `eye_r` (3,) [m].

        Self-occlusion of surfaces is included. The image borders are not considered.
        """
        hidden = np.zeros(points_r.shape[:-1], np.bool_)
        for body in self.bodies:
            hidden |= body.shadowed(points_r, eye_r, pose.identity())
        return hidden


@dataclass(frozen=True, eq=False)
class Scene:
    """Moving bodies in front of a wall.

    Attributes:
        surfaces: the tracked surfaces; they never occlude each other.
        wall: texture of the wall, centred on the rig's z axis.
        occluders: bodies that are always in front of the surfaces.
        T_rw: pose of the wall: its plane is z = 0 of frame w; by default z = `WALL_Z` of the rig.
    """

    surfaces: tuple[Surface, ...]
    wall: Texture
    occluders: tuple[MovingBody, ...] = ()
    T_rw: Pose = field(default_factory=lambda: pose.from_rotation_vector((0, 0, 0), (0, 0, WALL_Z)))

    def at(self, t: float) -> Moment:
        """All bodies at time `t` [s] after the start."""
        return Moment(tuple(surface.at(t) for surface in self.surfaces), tuple(thing.at(t) for thing in self.occluders))
