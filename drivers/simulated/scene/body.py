"""Interfaces of a scene's parts: bodies at one moment, and moving bodies."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from calib.pose import Pose


@dataclass(frozen=True, eq=False)
class RayImage:
    """Noise-free result of casting rays at one body; all arrays are (height, width).

    Attributes:
        share: coverage of each pixel by the body, 0 to 1.
        distance: radial distance of the body [m], NaN where the share is 0; likewise for the cosine.
        cosine: of the angle of incidence on the body.
        albedo: red, green, blue and infra-red reflectivity, (height, width, 4); 0 where the share is 0.
    """

    share: NDArray[np.float32]
    distance: NDArray[np.float32]
    cosine: NDArray[np.float32]
    albedo: NDArray[np.float32]


class Body(Protocol):
    """A solid body at one moment."""

    def outline(self) -> NDArray[np.float64]:
        """Rig points (n, 3) [m] that bound the body: their projections enclose it up to 3 px."""
        ...

    def cast(self, rays: NDArray[np.float64], T_rs: Pose) -> RayImage:
        """Casts a camera's rays at the body.

        Args:
            rays: unit directions of neighbouring pixels in the sensor frame, (height, width, 3), contiguous.
            T_rs: pose of the sensor.
        """
        ...

    def shadowed(self, points_s: NDArray[np.float64], light_s: NDArray[np.float64], T_rs: Pose) -> NDArray[np.bool_]:
        """Shadow mask (height, width): True where the body blocks a light at `light_s` (3,) [m] from points [m].

        `points_s` is (height, width, 3). Both are in a frame s that `T_rs` maps to the rig. The body's lit side is not
        shadowed by itself.
        """
        ...


class SurfaceBody(Body, Protocol):
    """A body that is a bent rectangle of material."""

    def grid(self, rows: int, columns: int) -> NDArray[np.float64]:
        """Rig coordinates (rows, columns, 3) [m] of a regular grid of material points, borders included."""
        ...


class MovingBody(Protocol):
    """A moving body."""

    def at(self, t: float) -> Body:
        """The body at time `t` [s] after the start."""
        ...


class Surface(Protocol):
    """A moving surface to track."""

    def at(self, t: float) -> SurfaceBody:
        """The surface at time `t` [s] after the start."""
        ...
