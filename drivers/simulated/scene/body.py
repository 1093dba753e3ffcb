"""What a scene is made of: bodies, solid at one moment, and the things that become a body at every moment."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from calib.pose import Pose


@dataclass(frozen=True, eq=False)
class RayImage:
    """What some lines of sight see of one body, noise-free; every array covers the rays (height, width).

    Attributes:
        share: part of each pixel that the body fills, 0 to 1.
        distance: radial distance of the body [m], NaN where the share is 0; so for the cosine.
        cosine: of the angle of incidence on the body.
        albedo: red, green, blue and infra-red reflectivity, (height, width, 4); 0 where the share is 0.
    """

    share: NDArray[np.float32]
    distance: NDArray[np.float32]
    cosine: NDArray[np.float32]
    albedo: NDArray[np.float32]


class Body(Protocol):
    """Something solid at one moment."""

    def outline(self) -> NDArray[np.float64]:
        """Rig points (…, 3) [m] around the body: in every image their pixels enclose it, but for 3 pixels."""
        ...

    def cast(self, rays: NDArray[np.float64], T_rs: Pose) -> RayImage:
        """What a camera sees of the body.

        Args:
            rays: unit directions of neighbouring pixels in the sensor frame, (height, width, 3), contiguous.
            T_rs: pose of the sensor.
        """
        ...

    def shadowed(self, points_s: NDArray[np.float64], light_s: NDArray[np.float64], T_rs: Pose) -> NDArray[np.bool_]:
        """Whether the body keeps a light at `light_s` (3,) [m] from points (height, width, 3) [m].

        Both are given in a frame s that `T_rs` maps to the rig. The body's own lit side is not in its shadow.
        """
        ...


class SurfaceBody(Body, Protocol):
    """A body that is a rectangle of material, however bent."""

    def grid(self, rows: int, columns: int) -> NDArray[np.float64]:
        """Rig coordinates (rows, columns, 3) [m] of a regular grid of material points that reaches the rims."""
        ...


class MovingBody(Protocol):
    """What moves."""

    def at(self, t: float) -> Body:
        """The thing at time `t` [s] after the start."""
        ...


class Surface(Protocol):
    """What moves and is to be tracked."""

    def at(self, t: float) -> SurfaceBody:
        """The surface at time `t` [s] after the start."""
        ...
