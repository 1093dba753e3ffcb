"""Residuals of one sensor and their Jacobians: corners in its image, distances to the board's plane.

Jacobians are dense, with the same columns for every row; the board pose that the columns refer to varies by row.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.solve.bundle import rotations
from calib.solve.bundle.motion import ViewPoses
from calib.solve.bundle.parameters.lens_parameters import MATRIX


@dataclass(frozen=True)
class JacobianBlocks:
    """Jacobian blocks of normalised residuals (n,).

    Attributes:
        intrinsics: with respect to fx, fy, cx, cy and all lens coefficients (n, 4 + k).
        pose: with respect to a small rotation and translation of the sensor (n, 6).
        board: with respect to a small rotation and translation of the board (n, 6).
        depth: with respect to depth_offset and depth_scale (n, 2).
    """

    intrinsics: NDArray[np.float64]
    pose: NDArray[np.float64]
    board: NDArray[np.float64]
    depth: NDArray[np.float64]


@dataclass(frozen=True)
class Corners:
    """Corners detected by one sensor.

    Attributes:
        points_b: in the board's frame (n, 3) [m].
        pixels: detected positions (n, 2) [px].
        sigmas: standard deviation of a coordinate (n,) [px].
        views: index of the view of each corner (n,).
    """

    points_b: NDArray[np.float64]
    pixels: NDArray[np.float64]
    sigmas: NDArray[np.float64]
    views: NDArray[np.intp]

    def residuals(self, camera: Camera, placed: ViewPoses) -> NDArray[np.float64]:
        """Normalised residuals (2 n,): predicted minus measured u and v of each corner."""
        predicted = camera.project(self._points_r(placed))
        return ((predicted - self.pixels) / self.sigmas[:, None]).ravel()

    def jacobian_blocks(self, camera: Camera, placed: ViewPoses) -> JacobianBlocks:
        """Jacobian blocks of `residuals`."""
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
        return JacobianBlocks(
            (by_intrinsics(camera, ideal) * weights).reshape(count, -1),
            moved_sensor.reshape(count, 6),
            moved_board.reshape(count, 6),
            np.zeros((count, 2)),
        )

    def _points_r(self, placed: ViewPoses) -> NDArray[np.float64]:
        turned = np.einsum("nij,nj->ni", placed.rotations[self.views], self.points_b)
        return turned + placed.translations[self.views]


@dataclass(frozen=True)
class Planes:
    """Distances that one depth sensor measured on the board.

    Attributes:
        pixels: (n, 2) [px].
        distances: radial (n,) [m].
        sigmas: standard deviations (n,) [m].
        views: index of the view of each distance (n,).
    """

    pixels: NDArray[np.float64]
    distances: NDArray[np.float64]
    sigmas: NDArray[np.float64]
    views: NDArray[np.intp]

    def residuals(
        self, camera: Camera, placed: ViewPoses, depth_offset: float, depth_scale: float
    ) -> NDArray[np.float64]:
        """Normalised residuals (n,): predicted minus measured distance."""
        directions_r = camera.directions(self.pixels) @ camera.T_rs[:3, :3].T
        distances, _, _ = self._meet(camera, placed, directions_r)
        return ((1 + depth_scale) * distances + depth_offset - self.distances) / self.sigmas

    def jacobian_blocks(self, camera: Camera, placed: ViewPoses, depth_scale: float) -> JacobianBlocks:
        """Jacobian blocks of `residuals`."""
        directions_s = camera.directions(self.pixels)
        directions_r = directions_s @ camera.T_rs[:3, :3].T
        distances, normals, along = self._meet(camera, placed, directions_r)
        weights = (1 / self.sigmas)[:, None]
        gain = weights * (1 + depth_scale) / along[:, None]
        to_board = placed.translations[self.views] - camera.T_rs[:3, 3]
        by_origin = gain * normals
        by_normal = gain * (to_board - distances[:, None] * directions_r)
        by_direction = -gain * distances[:, None] * normals
        # A small rotation dw changes a vector v by dw × v, and g · (dw × v) = (v × g) · dw.
        board = np.concatenate([np.cross(normals, by_normal), by_origin], axis=1)
        sensor = np.concatenate([np.cross(directions_r, by_direction), -by_origin], axis=1)
        bent = directions_by_intrinsics(camera, directions_s)
        intrinsics = np.einsum("ni,nij->nj", by_direction @ camera.T_rs[:3, :3], bent)
        return JacobianBlocks(
            intrinsics, sensor, board, np.concatenate([weights, weights * distances[:, None]], axis=1)
        )

    def _meet(
        self, camera: Camera, placed: ViewPoses, directions_r: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], ...]:
        """Distances (n,) from the camera to the board along the rays, board normals (n, 3), and ray · normal (n,)."""
        normals = placed.rotations[self.views, :, 2]
        along = np.sum(normals * directions_r, axis=1)
        above = np.sum(normals * (placed.translations[self.views] - camera.T_rs[:3, 3]), axis=1)
        return above / along, normals, along


def by_intrinsics(camera: Camera, ideal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Jacobian (n, 2, 4 + k) of pixels at ideal coordinates (n, 2) with respect to the intrinsics."""
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
    """Jacobian (n, 3, 4 + k) of the unit directions (n, 3) of fixed pixels with respect to the intrinsics.

    The pixel stays fixed while the intrinsics change, so this is the implicit derivative of the projection.
    """
    ideal = directions[:, :2] / directions[:, 2:]
    by_ideal = camera.lens.jacobian(ideal) * np.array([camera.fx, camera.fy])[:, None]
    moved = -np.linalg.solve(by_ideal, by_intrinsics(camera, ideal))
    # d = v / ‖v‖ with v = (x, y, 1) and ‖v‖ = 1 / d_z.
    across = (np.eye(3) - directions[:, :, None] * directions[:, None, :]) * directions[:, 2, None, None]
    return across[:, :, :2] @ moved
