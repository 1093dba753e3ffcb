"""Ray casting of planes and balls: an exact truth for warping."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.camera import Camera


class Solid(Protocol):
    """A shape that rays can intersect."""

    def meet(self, origin: NDArray[np.float64], rays: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distances (…,) [m] at which rays (…, 3) from an origin (3,) meet it first; infinite or NaN if they do not."""
        ...


@dataclass(frozen=True)
class Plane:
    """The points p with normal · p = offset, or the part of it with x and y inside a box (low, high)."""

    normal: NDArray[np.float64]
    offset: float
    box: tuple[float, float, float, float] = (-np.inf, np.inf, -np.inf, np.inf)

    def meet(self, origin: NDArray[np.float64], rays: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Solid`."""
        with np.errstate(divide="ignore", invalid="ignore"):
            far = (self.offset - origin @ self.normal) / (rays @ self.normal)
            x, y = np.moveaxis((origin + rays * far[..., None])[..., :2], -1, 0)
        left, right, top, bottom = self.box
        return np.where((far > 0) & (x >= left) & (x <= right) & (y >= top) & (y <= bottom), far, np.inf)


@dataclass(frozen=True)
class Ball:
    """A ball around a center [m]."""

    center: NDArray[np.float64]
    radius: float

    def meet(self, origin: NDArray[np.float64], rays: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Solid`."""
        along = rays @ (self.center - origin)
        inside = self.radius**2 - np.sum((self.center - origin) ** 2) + along**2
        with np.errstate(invalid="ignore"):
            return along - np.sqrt(inside)


def cast(camera: Camera, directions: NDArray[np.float64], solids: tuple[Solid, ...]) -> NDArray[np.float64]:
    """Radial distances (…,) [m] from a camera along sensor directions (…, 3) to what is nearest; NaN if nothing is."""
    rays = directions @ camera.T_rs[:3, :3].T
    nearest = np.fmin.reduce([solid.meet(camera.center, rays) for solid in solids])
    return np.where(np.isfinite(nearest), nearest, np.nan)


def image(camera: Camera, solids: tuple[Solid, ...]) -> NDArray[np.float64]:
    """Radial distances (height, width) [m] of what a camera sees."""
    return cast(camera, camera.rays(), solids)


def seen_by(
    camera: Camera, points: NDArray[np.float64], solids: tuple[Solid, ...]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Masks of the rig points (…, 3) inside a camera's image, and of those that are also visible there."""
    place = camera.project(points)
    with np.errstate(invalid="ignore"):
        inside = np.all((place >= 0) & (place <= (camera.width - 1, camera.height - 1)), axis=-1)
    inside &= camera.in_field(points)
    direction = pose.transform(camera.T_sr, points)
    length = np.linalg.norm(direction, axis=-1)
    first = cast(camera, direction / length[..., None], solids)
    return inside, inside & (np.abs(first - length) < 1e-6)
