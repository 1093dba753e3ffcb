"""Projection of the vertices of a population into one camera's image, in single precision."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.jit import composed, kernel
from calib.lenses.forward import brown_conrady_coefficients as coefficients
from calib.lenses.forward import distort, lens_parts


class Optics(NamedTuple):
    """A camera, as kernels take it.

    Attributes:
        pose: T_sr (3, 4).
        matrix: fx, fy, cx and cy (4,) [px].
        lens: coefficients of the lens.
        limit: largest u² + w² of a line of sight (u, w, 1) within the field of view.
        height, width: of the image [px].
    """

    pose: NDArray[np.float32]
    matrix: NDArray[np.float32]
    lens: NDArray[np.float32]
    limit: float
    height: int
    width: int

    @classmethod
    def of(cls, camera: Camera) -> "Optics":
        """Optics of a camera, in single precision."""
        pose = np.ascontiguousarray(camera.T_sr[:3], np.float32)
        matrix = np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32)
        lens = camera.lens.coefficients.astype(np.float32)
        return cls(pose, matrix, lens, camera.field_radius**2, camera.height, camera.width)


class Projected(NamedTuple):
    """Vertices of a population in one camera's image.

    Attributes:
        place: pixel coordinates (population, n, 2); 0 for a vertex that the camera cannot see.
        inverse_z: 1/z (population, n) [1/m]; NaN for a vertex outside the field of view or behind the camera.
    """

    place: NDArray[np.float32]
    inverse_z: NDArray[np.float32]


class Projection:
    """Eq. 10 for populations, in single precision.

    Attributes:
        optics: of the camera.
    """

    def __init__(self, camera: Camera):
        self.optics = Optics.of(camera)
        self._project = composed(_project, **lens_parts(camera.lens))

    def project(self, vertices: NDArray[np.float32]) -> Projected:
        """The vertices (population, 3, n) [m] in the image."""
        population, _, n = vertices.shape
        found = Projected(np.empty((population, n, 2), np.float32), np.empty((population, n), np.float32))
        self._project(vertices, self.optics, found)
        return found


def in_sight(seen: Projected, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Share (population,) of projected vertices inside an image of a shape (height, width)."""
    count = np.zeros(len(seen.place), np.int64)
    _count_inside(seen, shape[0], shape[1], count)
    return count / seen.place.shape[1]


def extent(seen: Projected) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Minimum and maximum (row, column) of all vertices that the camera can see; ∞ and −∞ without any."""
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    _extent(seen, low, high)
    return low, high


@kernel
def _extent(seen: Projected, low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
    """Lowers `low` and raises `high` (2,) to the results of `extent`."""
    for k in range(seen.place.shape[0]):
        for v in range(seen.place.shape[1]):
            if not np.isnan(seen.inverse_z[k, v]):
                for axis in range(2):
                    low[1 - axis] = min(low[1 - axis], seen.place[k, v, axis])
                    high[1 - axis] = max(high[1 - axis], seen.place[k, v, axis])


@kernel
def _count_inside(seen: Projected, height: int, width: int, count: NDArray[np.int64]) -> None:
    """Number of vertices of every candidate that the camera can see and that lie inside its image."""
    half = np.float32(0.5)
    right, bottom = np.float32(width) - half, np.float32(height) - half
    for k in range(seen.place.shape[0]):
        for v in range(seen.place.shape[1]):
            x, y = seen.place[k, v, 0], seen.place[k, v, 1]
            inside = x >= -half and x < right and y >= -half and y < bottom
            count[k] += 1 if inside and not np.isnan(seen.inverse_z[k, v]) else 0


@kernel
def _project(vertices: NDArray[np.float32], optics: Optics, found: Projected) -> None:
    """Writes eq. 10 of vertices (population, 3, n) [m]."""
    one, farthest, pose = np.float32(1), np.float32(optics.limit), optics.pose
    (fx, fy, cx, cy), own_lens = optics.matrix, coefficients(optics.lens)
    place, inverse_z = found.place, found.inverse_z
    for k in range(vertices.shape[0]):
        for v in range(vertices.shape[2]):
            a, b, c = vertices[k, 0, v], vertices[k, 1, v], vertices[k, 2, v]
            x = pose[0, 0] * a + pose[0, 1] * b + pose[0, 2] * c + pose[0, 3]
            y = pose[1, 0] * a + pose[1, 1] * b + pose[1, 2] * c + pose[1, 3]
            z = pose[2, 0] * a + pose[2, 1] * b + pose[2, 2] * c + pose[2, 3]
            inverse = one / z
            u, w = x * inverse, y * inverse
            seen = z > np.float32(1e-6) and u * u + w * w < farthest
            bent_u, bent_w = distort(u, w, own_lens)
            place[k, v, 0] = fx * bent_u + cx if seen else np.float32(0)
            place[k, v, 1] = fy * bent_w + cy if seen else np.float32(0)
            inverse_z[k, v] = inverse if seen else np.float32(np.nan)
