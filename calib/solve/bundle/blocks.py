"""Residuals of one sensor and their derivatives: corners in its image, distances to the board's plane.

The derivatives come as a dense array of the same columns for every row; which board they are of differs.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.solve.bundle import rotations
from calib.solve.bundle.lens_parameters import MATRIX
from calib.solve.bundle.motion import Placed


@dataclass(frozen=True)
class Derivatives:
    """Of residuals (n,), whitened.

    Attributes:
        intrinsics: by fx, fy, cx, cy and all coefficients of the lens (n, 4 + k).
        pose: by the sensor's small turn and displacement (n, 6).
        board: by the board's (n, 6).
        depth: by depth_offset and depth_scale (n, 2).
    """

    intrinsics: NDArray[np.float64]
    pose: NDArray[np.float64]
    board: NDArray[np.float64]
    depth: NDArray[np.float64]


@dataclass(frozen=True)
class Corners:
    """All corners that a sensor saw.

    Attributes:
        points_b: in the board's frame (n, 3) [m].
        pixels: where the image shows them (n, 2) [px].
        sigmas: deviation of a coordinate (n,) [px].
        views: number of the view that each belongs to (n,).
    """

    points_b: NDArray[np.float64]
    pixels: NDArray[np.float64]
    sigmas: NDArray[np.float64]
    views: NDArray[np.intp]

    def residuals(self, camera: Camera, placed: Placed) -> NDArray[np.float64]:
        """(2 n,): u and v of each corner in turn, predicted less measured, in deviations."""
        predicted = camera.project(self._points_r(placed))
        return ((predicted - self.pixels) / self.sigmas[:, None]).ravel()

    def derivatives(self, camera: Camera, placed: Placed) -> Derivatives:
        """Of `residuals`."""
        points_r = self._points_r(placed)
        from_board = points_r - placed.translations[self.views]
        from_sensor = points_r - camera.T_rs[:3, 3]
        points_s = from_sensor @ camera.T_rs[:3, :3]
        ideal = points_s[:, :2] / points_s[:, 2:]
        weights = 1 / self.sigmas[:, None, None]
        by_point = camera.projection_jacobian(points_r) * weights
        moved_board = np.concatenate([by_point @ -rotations.cross(from_board), by_point], axis=-1)
        moved_sensor = np.concatenate([by_point @ rotations.cross(from_sensor), -by_point], axis=-1)
        count = 2 * len(self.points_b)
        return Derivatives(
            (by_intrinsics(camera, ideal) * weights).reshape(count, -1),
            moved_sensor.reshape(count, 6),
            moved_board.reshape(count, 6),
            np.zeros((count, 2)),
        )

    def _points_r(self, placed: Placed) -> NDArray[np.float64]:
        turned = np.einsum("nij,nj->ni", placed.rotations[self.views], self.points_b)
        return turned + placed.translations[self.views]


@dataclass(frozen=True)
class Planes:
    """All distances that a depth sensor measured on the board.

    Attributes:
        pixels: (n, 2) [px].
        distances: radial (n,) [m].
        sigmas: their deviations (n,) [m].
        views: number of the view that each belongs to (n,).
    """

    pixels: NDArray[np.float64]
    distances: NDArray[np.float64]
    sigmas: NDArray[np.float64]
    views: NDArray[np.intp]

    def residuals(self, camera: Camera, placed: Placed, depth_offset: float, depth_scale: float) -> NDArray[np.float64]:
        """(n,): predicted less measured, in deviations."""
        directions_r = camera.directions(self.pixels) @ camera.T_rs[:3, :3].T
        distances, _, _ = self._meet(camera, placed, directions_r)
        return ((1 + depth_scale) * distances + depth_offset - self.distances) / self.sigmas

    def derivatives(self, camera: Camera, placed: Placed, depth_scale: float) -> Derivatives:
        """Of `residuals`."""
        directions_s = camera.directions(self.pixels)
        directions_r = directions_s @ camera.T_rs[:3, :3].T
        distances, normals, along = self._meet(camera, placed, directions_r)
        weights = (1 / self.sigmas)[:, None]
        gain = weights * (1 + depth_scale) / along[:, None]
        to_board = placed.translations[self.views] - camera.T_rs[:3, 3]
        by_origin = gain * normals
        by_normal = gain * (to_board - distances[:, None] * directions_r)
        by_direction = -gain * distances[:, None] * normals
        # A turn dw moves a vector v by dw × v, and g · (dw × v) = (v × g) · dw.
        board = np.concatenate([np.cross(normals, by_normal), by_origin], axis=1)
        sensor = np.concatenate([np.cross(directions_r, by_direction), -by_origin], axis=1)
        bent = directions_by_intrinsics(camera, directions_s)
        intrinsics = np.einsum("ni,nij->nj", by_direction @ camera.T_rs[:3, :3], bent)
        return Derivatives(intrinsics, sensor, board, np.concatenate([weights, weights * distances[:, None]], axis=1))

    def _meet(
        self, camera: Camera, placed: Placed, directions_r: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], ...]:
        """Distances (n,) at which lines of sight meet the board, its normals (n, 3), and direction · normal (n,)."""
        normals = placed.rotations[self.views, :, 2]
        along = np.sum(normals * directions_r, axis=1)
        above = np.sum(normals * (placed.translations[self.views] - camera.T_rs[:3, 3]), axis=1)
        return above / along, normals, along


def by_intrinsics(camera: Camera, ideal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivatives (n, 2, 4 + k) of pixels by the camera matrix and the lens at ideal coordinates (n, 2)."""
    focal = np.array([camera.fx, camera.fy])
    bent = camera.lens.coefficient_jacobian(ideal) * focal[:, None]
    result = np.zeros((len(ideal), 2, len(MATRIX) + bent.shape[-1]))
    distorted = camera.lens.distort(ideal)
    result[:, 0, 0] = distorted[:, 0]
    result[:, 1, 1] = distorted[:, 1]
    result[:, 0, 2] = result[:, 1, 3] = 1
    result[:, :, 4:] = bent
    return result


def directions_by_intrinsics(camera: Camera, directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivatives (n, 3, 4 + k) of the unit directions (n, 3) that belong to fixed pixels.

    A pixel stays where it is while the intrinsics change, so the ideal coordinates move against the projection.
    """
    ideal = directions[:, :2] / directions[:, 2:]
    by_ideal = camera.lens.jacobian(ideal) * np.array([camera.fx, camera.fy])[:, None]
    moved = -np.linalg.solve(by_ideal, by_intrinsics(camera, ideal))
    # d = v / ‖v‖ with v = (x, y, 1) and ‖v‖ = 1 / d_z.
    across = (np.eye(3) - directions[:, :, None] * directions[:, None, :]) * directions[:, 2, None, None]
    return across[:, :, :2] @ moved
