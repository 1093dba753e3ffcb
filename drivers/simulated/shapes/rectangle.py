"""A rectangle that bends onto a cylinder and moves."""

from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.pose import Pose
from drivers.simulated.scene.body import RayImage
from drivers.simulated.scene.excursion import Excursion
from drivers.simulated.scene.motion import Placement
from drivers.simulated.scene.raycast import antialias_edges, cast, shadowed
from drivers.simulated.scene.surface import surface_points
from drivers.simulated.scene.texture import Texture

#: Points per side of the grid that bounds the rectangle in images.
_OUTLINE_POINTS = 13


class Trajectory(Protocol):
    """Motion of a rectangle, such as `drivers.simulated.scene.motion.Motion`."""

    def at(self, t: float) -> Placement:
        """The placement at time `t` [s] after the start."""
        ...


@dataclass(frozen=True, eq=False)
class Rectangle:
    """A moving rectangle."""

    width: float
    height: float
    motion: Trajectory
    texture: Texture
    excursion: Excursion = field(default_factory=Excursion)

    def at(self, t: float) -> "PlacedRectangle":
        """The rectangle at time `t` [s] after the start."""
        placement = self.motion.at(t)
        placement = replace(placement, T_rp=self.excursion.displaced(placement.T_rp, t))
        return PlacedRectangle(self.width, self.height, self.texture, placement)


@dataclass(frozen=True, eq=False)
class PlacedRectangle:
    """The rectangle at one moment; see `drivers.simulated.scene.body.SurfaceBody`."""

    width: float
    height: float
    texture: Texture
    placement: Placement

    def grid(self, rows: int, columns: int) -> NDArray[np.float64]:
        """See `SurfaceBody.grid`."""
        a = np.linspace(-self.width / 2, self.width / 2, columns)
        b = np.linspace(-self.height / 2, self.height / 2, rows)
        return surface_points(self.placement, *np.meshgrid(a, b))

    def outline(self) -> NDArray[np.float64]:
        """See `Body.outline`."""
        return self.grid(_OUTLINE_POINTS, _OUTLINE_POINTS)

    def cast(self, rays: NDArray[np.float64], T_rs: Pose) -> RayImage:
        """See `Body.cast`."""
        T_bs, shape = self._into_bend(T_rs), self._shape()
        sight, share = cast(rays, T_bs, shape)
        antialias_edges(rays, T_bs, shape, sight, share)
        distance, a, b, cosine = sight
        return RayImage(share, distance, cosine, self.texture.at(a, b))

    def shadowed(self, points_s: NDArray[np.float64], light_s: NDArray[np.float64], T_rs: Pose) -> NDArray[np.bool_]:
        """See `Body.shadowed`."""
        T_bs = self._into_bend(T_rs)
        return shadowed(pose.transform(T_bs, points_s), pose.transform(T_bs, light_s), self._shape())

    def _into_bend(self, T_rs: Pose) -> Pose:
        return np.ascontiguousarray(pose.inverse(self.placement.T_rb) @ T_rs)

    def _shape(self) -> NDArray[np.float64]:
        """Kernel parameters: curvature, cosine and sine of the direction, offset, half width, half height."""
        direction = self.placement.direction
        bend = (self.placement.curvature, np.cos(direction), np.sin(direction), self.placement.offset)
        return np.array([*bend, self.width / 2, self.height / 2])
