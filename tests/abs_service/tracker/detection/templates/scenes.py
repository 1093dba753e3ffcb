"""Ray-cast depth and colour images of known objects before a wall: sheet, ellipsoid and box, with an occluder."""

from dataclasses import dataclass, field, replace

import numpy as np

import abs_service as a
from calib import pose

CAMERA = a.Camera(160, 120, fx=200, fy=200, cx=79.5, cy=59.5)
#: Standard deviation of rendered depths [m], and the noise model that describes it.
SIGMA_M = 0.002
NOISE = a.noise.Constant(SIGMA_M)
WALL_M = 1.4


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid around the origin with three half axes [m]."""

    half: tuple[float, float, float] = (0.12, 0.08, 0.05)

    def meet(self, origin, rays):
        """First distances (…,) at which rays (…, 3) from a point (3,) meet it; NaN if they do not."""
        from_origin, directions = origin / self.half, rays / self.half
        a, b = (directions**2).sum(-1), directions @ from_origin
        with np.errstate(invalid="ignore"):
            return (-b - np.sqrt(b**2 - a * (from_origin @ from_origin - 1))) / a


@dataclass(frozen=True)
class Box:
    """A box around the origin with three half sides [m]; a sheet, if the last one is 0."""

    half: tuple[float, float, float] = (0.11, 0.07, 0.045)

    def meet(self, origin, rays):
        """See `Ellipsoid`: the slab method."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.stack([(side * np.array(self.half) - origin) / rays for side in (-1, 1)])
        enter, leave = ends.min(axis=0).max(axis=-1), ends.max(axis=0).min(axis=-1)
        return np.where(enter <= leave, enter, np.nan)


def print_of(points):
    """Red, green, blue (…, 3) at points (…, 3) of an object [m]: smooth waves, of no symmetry."""
    x, y, z = np.moveaxis(points, -1, 0)
    red, green = np.sin(x / 0.012 + 1) * np.cos(y / 0.015), np.sin(y / 0.011 + z / 0.013 + 2 * np.cos(x / 0.03))
    return 120 + 80 * np.stack([red, green, np.cos(x / 0.02 + z / 0.02)], axis=-1)


@dataclass(frozen=True)
class Scene:
    """A shape at a pose, before a wall and perhaps behind a board.

    Attributes:
        shape: has `meet`.
        T_ro: pose of the object.
        board: left, right, top and bottom [m] of an occluder at z = 0.4 m; empty without.
    """

    shape: Ellipsoid | Box
    T_ro: np.ndarray = field(default_factory=lambda: np.eye(4))
    board: tuple[float, ...] = ()

    def seen(self, camera=CAMERA):
        """Radial distances (height, width) [m], and of each pixel the point of the object [m], NaN elsewhere."""
        rays = camera.rays() @ camera.T_rs[:3, :3].T
        T_or = pose.inverse(self.T_ro)
        own = rays @ T_or[:3, :3].T
        distance = self.shape.meet(pose.transform(T_or, camera.center), own)
        points = pose.transform(T_or, camera.center) + own * distance[..., None]
        wall = (WALL_M - camera.center[2]) / rays[..., 2]
        shown = np.isfinite(distance)
        if self.board:
            at = 0.4 * rays / rays[..., 2:]
            left, right, top, bottom = self.board
            before = (at[..., 0] > left) & (at[..., 0] < right) & (at[..., 1] > top) & (at[..., 1] < bottom)
            wall, shown = np.where(before, 0.4 / rays[..., 2], wall), shown & ~before
        return np.where(shown, distance, wall), np.where(shown[..., None], points, np.nan)

    def depth(self, seed, camera=CAMERA):
        """Noisy depth image [m] along z."""
        noisy = self.seen(camera)[0]
        noisy = noisy + np.random.default_rng(seed).normal(0, SIGMA_M, noisy.shape)
        return noisy * camera.rays()[..., 2]

    def image(self, camera=CAMERA):
        """Colour image: the `print_of` the object on black."""
        points = self.seen(camera)[1]
        return np.where(np.isfinite(points[..., :1]), np.nan_to_num(print_of(points)), 0).astype(np.uint8)

    def mask(self, camera=CAMERA):
        """Pixels of the object, without those at its rim."""
        inside = np.isfinite(self.seen(camera)[1][..., 0])
        padded = np.pad(inside, 1)
        return np.all(
            [np.roll(padded, s, (0, 1))[1:-1, 1:-1] for s in ((0, 0), (0, 1), (1, 0), (0, -1), (-1, 0))], axis=0
        )

    def moved(self, rotation_vector, translation):
        """The same scene with the object moved about its own centre."""
        moved = pose.from_rotation_vector(rotation_vector, np.zeros(3)) @ self.T_ro
        moved[:3, 3] = self.T_ro[:3, 3] + translation
        return replace(self, T_ro=moved)
