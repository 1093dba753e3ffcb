"""What two cameras see of planes and balls, by casting rays: no part of the warping takes part."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from calib import pose
from calib.camera import Camera
from calib.fisheye import KannalaBrandt
from calib.lens import Lens

SOURCE = Camera(64, 56, 60.0, 60.5, 31.2, 28.1, Lens(np.array([-0.15, 0.03, 1e-3, -1e-3])))
BESIDE = pose.from_rotation_vector([0.02, -0.2, 0.03], [0.22, -0.02, 0.01])
VIEWS = {
    "pinhole": Camera(96, 72, 85.0, 86.0, 47.1, 35.8, T_rs=BESIDE),
    "brown_conrady": Camera(96, 72, 85.0, 86.0, 47.1, 35.8, Lens(np.array([-0.12, 0.03])), BESIDE),
    "fisheye": Camera(96, 72, 60.0, 61.0, 47.1, 35.8, KannalaBrandt(np.array([0.02, -0.01, 4e-3, -1e-3])), BESIDE),
}


class Solid(Protocol):
    """What a ray may meet."""

    def meet(self, origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
        """Distances (…,) [m] at which rays (…, 3) from an origin (3,) meet it first; infinite or NaN if they do not."""
        ...


@dataclass(frozen=True)
class Plane:
    """The points p with normal · p = offset, or the part of it with x and y inside a box (low, high)."""

    normal: np.ndarray
    offset: float
    box: tuple[float, float, float, float] = (-np.inf, np.inf, -np.inf, np.inf)

    def meet(self, origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
        with np.errstate(divide="ignore", invalid="ignore"):
            far = (self.offset - origin @ self.normal) / (rays @ self.normal)
            x, y = np.moveaxis((origin + rays * far[..., None])[..., :2], -1, 0)
        left, right, top, bottom = self.box
        return np.where((far > 0) & (x >= left) & (x <= right) & (y >= top) & (y <= bottom), far, np.inf)


@dataclass(frozen=True)
class Ball:
    """A ball around a center [m]."""

    center: np.ndarray
    radius: float

    def meet(self, origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
        along = rays @ (self.center - origin)
        inside = self.radius**2 - np.sum((self.center - origin) ** 2) + along**2
        with np.errstate(invalid="ignore"):
            return along - np.sqrt(inside)


WALL = Plane(np.array([-0.2, 0.1, 1.0]), 1.2)
BOARD = Plane(np.array([0.1, 0.05, 1.0]), 0.8, (-0.11, 0.13, -0.09, 0.12))


def cast(camera: Camera, directions: np.ndarray, solids: tuple[Solid, ...]) -> np.ndarray:
    """Radial distances (…,) [m] from a camera along sensor directions (…, 3) to what is nearest; NaN if nothing is."""
    rays = directions @ camera.T_rs[:3, :3].T
    nearest = np.fmin.reduce([solid.meet(camera.center, rays) for solid in solids])
    return np.where(np.isfinite(nearest), nearest, np.nan)


def image(camera: Camera, solids: tuple[Solid, ...]) -> np.ndarray:
    """Radial distances (height, width) [m] of what a camera sees."""
    return cast(camera, camera.rays(), solids)


def seen_by(camera: Camera, points: np.ndarray, solids: tuple[Solid, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Whether rig points (…, 3) are in a camera's image, and whether nothing hides them there."""
    place = camera.project(points)
    with np.errstate(invalid="ignore"):
        inside = np.all((place >= 0) & (place <= (camera.width - 1, camera.height - 1)), axis=-1)
    inside &= np.linalg.norm(pose.transform(camera.T_sr, points)[..., :2], axis=-1) < (
        camera.field_radius * pose.transform(camera.T_sr, points)[..., 2]
    )
    direction = pose.transform(camera.T_sr, points)
    length = np.linalg.norm(direction, axis=-1)
    first = cast(camera, direction / length[..., None], solids)
    return inside, inside & (np.abs(first - length) < 1e-6)
