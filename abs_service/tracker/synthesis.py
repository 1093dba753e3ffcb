"""Sparse synthesis: one value per vertex and sensor (section 3.1)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import Surface
from calib.camera import Camera
from calib.jit import kernel


@dataclass(frozen=True, slots=True, eq=False)
class Synthesis:
    """What a sensor would see of every vertex of a population.

    Attributes:
        pixel: index (population, n) into the sensor's flattened texture with a border of one pixel; 0, in the border,
            where the sensor cannot see the vertex (outside the image, behind the camera, or facing away).
        distance: radial distance from the camera centre (population, n) [m], eq. 11.
    """

    pixel: NDArray[np.int32]
    distance: NDArray[np.float32]


class SparseSynthesis:
    """Projects vertices into one camera with forward distortion, so that values are compared in the input domain."""

    def __init__(self, camera: Camera):
        self._pose = np.ascontiguousarray(camera.T_sr[:3], np.float32)
        self._matrix = np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32)
        self._lens = camera.lens.coefficients.astype(np.float32)
        self._size = (camera.height, camera.width)
        self._limit = _field_radius(camera) ** 2

    def synthesize(self, surface: Surface) -> Synthesis:
        """Synthesises a population of deformed meshes."""
        population, _, n = surface.vertices.shape
        pixel = np.empty((population, n), np.int32)
        distance = np.empty((population, n), np.float32)
        _synthesize(
            surface.vertices,
            surface.normals,
            self._pose,
            self._matrix,
            self._lens,
            self._limit,
            *self._size,
            pixel,
            distance,
        )
        return Synthesis(pixel, distance)


def _field_radius(camera: Camera) -> float:
    """Largest x/z and y/z, as a radius, that the camera sees.

    Beyond, the polynomial of a lens may fold back into the image, or leave the range of numbers.
    """
    columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rim = (columns % (camera.width - 1 or 1) == 0) | (rows % (camera.height - 1 or 1) == 0)
    directions = camera.directions(np.stack([columns[rim], rows[rim]], axis=-1))
    radius = np.linalg.norm(directions[:, :2], axis=1) / directions[:, 2]
    return float(radius.max() * (1 + 2 / min(camera.width, camera.height)) + 1 / min(camera.fx, camera.fy))


@kernel
def _synthesize(
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
    pose: NDArray[np.float32],
    matrix: NDArray[np.float32],
    lens: NDArray[np.float32],
    limit: float,
    height: int,
    width: int,
    pixel: NDArray[np.int32],
    distance: NDArray[np.float32],
) -> None:
    """Eqs. 10, 11 and 20 for a population; as in `SparseSynthesis` and `Synthesis`, pose (3, 4) = T_sr, limit of r²."""
    half, one, two = np.float32(0.5), np.float32(1), np.float32(2)
    fx, fy, cx, cy = matrix
    k1, k2, p1, p2, k3, k4, k5, k6 = lens
    stride = width + 2
    right, bottom, farthest = np.float32(width), np.float32(height), np.float32(limit)
    for k in range(vertices.shape[0]):
        for v in range(vertices.shape[2]):
            a, b, c = vertices[k, 0, v], vertices[k, 1, v], vertices[k, 2, v]
            x = pose[0, 0] * a + pose[0, 1] * b + pose[0, 2] * c + pose[0, 3]
            y = pose[1, 0] * a + pose[1, 1] * b + pose[1, 2] * c + pose[1, 3]
            z = pose[2, 0] * a + pose[2, 1] * b + pose[2, 2] * c + pose[2, 3]
            a, b, c = normals[k, 0, v], normals[k, 1, v], normals[k, 2, v]
            nx = pose[0, 0] * a + pose[0, 1] * b + pose[0, 2] * c
            ny = pose[1, 0] * a + pose[1, 1] * b + pose[1, 2] * c
            nz = pose[2, 0] * a + pose[2, 1] * b + pose[2, 2] * c
            inverse = one / z
            u, w = x * inverse, y * inverse
            r2 = u * u + w * w
            facing = nx * x + ny * y + nz * z < 0
            radial = (one + r2 * (k1 + r2 * (k2 + r2 * k3))) / (one + r2 * (k4 + r2 * (k5 + r2 * k6)))
            column = fx * (u * radial + two * p1 * u * w + p2 * (r2 + two * u * u)) + cx + half
            row = fy * (w * radial + p1 * (r2 + two * w * w) + two * p2 * u * w) + cy + half
            inside = column >= 0 and column < right and row >= 0 and row < bottom
            seen = facing and z > np.float32(1e-6) and r2 < farthest and inside
            pixel[k, v] = (np.int32(row) + 1) * stride + np.int32(column) + 1 if seen else 0
            distance[k, v] = np.sqrt(x * x + y * y + z * z)
