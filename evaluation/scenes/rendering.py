"""Renderer of dense grids of points: splatted on a finer raster, refined per sub-pixel, then averaged to pixels."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from evaluation.scenes import splatting
from evaluation.scenes.surfaces import NO_WALL, Sheet, Wall


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """Noise-free view of a camera.

    Attributes:
        distance: radial distances (height, width) [m]; a pixel that sees several surfaces has their mean, weighted with
            the light that comes from each; NaN where none comes back.
        light: of a lamp at the camera, what comes back (height, width): reflectivity · cosine of incidence / distance²
            [1/m²].
        color: red, green, blue (height, width, 3) in 0…255.
        share: of each pixel that the sheets cover (height, width), 0…1.
    """

    distance: NDArray[np.float64]
    light: NDArray[np.float64]
    color: NDArray[np.float64]
    share: NDArray[np.float64]


class Renderer:
    """Renders for one camera without distortion.

    Every point is projected to a sub-pixel, and the nearest point of each is kept (z-buffer). The line of sight through
    the sub-pixel's centre is then intersected with the surface around that point by one Newton step: distances are
    exact to the second order of half a sub-pixel, some micrometres, and rims to the grid.

    Args:
        camera: the camera.
        wall: what is behind everything.
        fineness: sub-pixels along each side of a pixel.
    """

    def __init__(self, camera: Camera, wall: Wall = NO_WALL, fineness: int = 3):
        if np.any(camera.lens.coefficients):
            raise ValueError("points are splatted through a pinhole, not through a lens that distorts")
        self.camera = camera
        self._n = fineness
        shift = (fineness - 1) / 2
        self._matrix = np.array([camera.fx, camera.fy, camera.cx, camera.cy]) * fineness + [0, 0, shift, shift]
        fx, fy, cx, cy = self._matrix
        fine = replace(camera, width=self._n * camera.width, height=self._n * camera.height, fx=fx, fy=fy, cx=cx, cy=cy)
        self._rays = np.ascontiguousarray(fine.rays())
        self._wall = self._seen_wall(wall)

    def render(self, *sheets: Sheet) -> View:
        """The view of some sheets and the wall."""
        seen = self._wall.copy()
        for sheet in sheets:
            points = np.empty(sheet.points.shape)
            splatting.transform(self.camera.T_sr, np.ascontiguousarray(sheet.points, float), points)
            winner = np.full(self._rays.shape[:2], -1)
            splatting.splat(points, self._matrix, winner)
            reflectivity, color = (np.ascontiguousarray(part, float) for part in (sheet.reflectivity, sheet.color))
            splatting.look(points, winner, self._rays, self._matrix[0], reflectivity, color, seen)
        mixed = np.empty((self.camera.height, self.camera.width, splatting.CHANNELS))
        splatting.mix(seen, self._n, mixed)
        with np.errstate(invalid="ignore", divide="ignore"):
            distance = mixed[..., 0] / mixed[..., 1]
        return View(distance, mixed[..., 1], mixed[..., 2:5], mixed[..., 5])

    def _seen_wall(self, wall: Wall) -> NDArray[np.float64]:
        """Sub-pixels (height, width, channels) that show the wall, as `splatting.look` writes them."""
        along = self._rays @ self.camera.T_rs[2, :3]
        with np.errstate(divide="ignore"):
            distance = (wall.depth - self.camera.center[2]) / along
        seen = np.zeros((*along.shape, splatting.CHANNELS))
        seen[..., 0] = np.where(distance > 0, np.minimum(distance, splatting.MAX_DISTANCE_M), splatting.MAX_DISTANCE_M)
        seen[..., 1] = wall.reflectivity * np.abs(along) / seen[..., 0] ** 2
        seen[..., 2:5] = wall.color
        return seen
