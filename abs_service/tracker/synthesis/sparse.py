"""Sparse direct synthesis: one value per vertex (section 3.1), forward distortion, compared in the input domain."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.observation import Observation
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.base import Synthesis, View
from abs_service.tracker.synthesis.raster import Raster, field_radius
from abs_service.tracker.synthesis.slopes import LEVEL, Relief, Slopes, half_pixel, surroundings
from calib.camera import Camera
from calib.jit import kernel
from calib.rig import Rig

#: A vertex is hidden behind the mesh's own surface if that is nearer to the camera by more than this [m].
HIDING_M = 0.01

#: Flattest angle (cosine) at which a surface's slope is followed to a pixel's centre.
LEAST_COSINE = 0.2


@dataclass(frozen=True)
class Settings:
    """Sparse direct synthesis has no keys."""

    def build(self, rig: Rig, mesh: Mesh) -> "Sparse":
        """The synthesis of a mesh for the sensors of a rig."""
        return Sparse(rig, mesh)


class Sparse:
    """Projects the vertices into the sensors' own images, which stay as they are.

    Attributes:
        canvas: the vertices and their surroundings.
    """

    def __init__(self, rig: Rig, mesh: Mesh):
        self._step_m = half_pixel(rig, mesh)
        self.canvas = surroundings(mesh, self._step_m)
        self._rig = rig
        self._mesh = mesh

    def observe(self, observation: Observation) -> None:
        """Nothing depends on the images."""

    def view(self, sensor: str, attributes: NDArray[np.float32]) -> View:
        """The vertices with attributes of the canvas through one sensor's camera.

        Attributes of the vertices alone (n, channels) are taken for the same all around.
        """
        camera, n = self._rig.sensors[sensor].camera, len(self._mesh.vertices)
        if len(attributes) != len(self.canvas.vertices):
            return SparseView(camera, self._mesh.faces, attributes)
        return SparseView(
            camera, self._mesh.faces, attributes[:n], Relief(camera, self._mesh, attributes[n:], self._step_m)
        )

    def texture(self, sensor: str, texture: NDArray[np.float32]) -> NDArray[np.float32]:
        """The texture itself."""
        return texture

    def image(self, sensor: str, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """The image itself."""
        return image


class SparseView:
    """The vertices of a mesh through one camera.

    Attributes:
        camera: the camera.
    """

    def __init__(
        self,
        camera: Camera,
        faces: NDArray[np.int32],
        attributes: NDArray[np.float32],
        slopes: Slopes = LEVEL,
    ):
        self.camera = camera
        self._raster = Raster(camera, faces)
        self._attributes = np.ascontiguousarray(attributes, np.float32)
        self._slopes = slopes
        self._hidden = np.zeros(len(attributes), np.bool_)
        self._pose = np.ascontiguousarray(camera.T_sr[:3], np.float32)
        self._matrix = np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32)
        self._lens = camera.lens.coefficients.astype(np.float32)
        self._kernel = _synthesize_pinhole if camera.lens.is_pinhole else _synthesize
        self._size = (camera.height, camera.width)
        self._limit = field_radius(camera) ** 2

    def look(self, predicted: Surface) -> None:
        """Hides the vertices that face away, or are behind the mesh's own surface, in the predicted mesh."""
        self._hidden = np.zeros(predicted.vertices.shape[2], np.bool_)
        self._slopes.look(predicted)
        seen = self.synthesize(predicted)
        stride = self.camera.width + 2
        row, column = np.divmod(seen.pixel[0], stride)
        front = np.pad(self.render(predicted), 1, constant_values=np.inf)[row, column]
        facing = np.einsum("in,in->n", predicted.normals[0], self._sight(predicted)) < 0
        self._hidden = ~facing | (front < seen.distance[0] - HIDING_M)

    def synthesize(self, surface: Surface) -> Synthesis:
        """Synthesises a population of deformed meshes; hidden vertices are no samples."""
        population, _, n = surface.vertices.shape
        pixel = np.empty((population, n), np.int32)
        distance = np.empty((population, n), np.float32)
        self._kernel(
            surface.vertices,
            surface.normals,
            self._hidden,
            self._pose,
            self._matrix,
            self._lens,
            self._limit,
            *self._size,
            pixel,
            distance,
        )
        return Synthesis(pixel, distance, self._slopes.at_centers(self._attributes, surface, pixel))

    def slopes(self, surface: Surface) -> NDArray[np.float32]:
        """As where the surface was expected."""
        return self._slopes.per_pixel(self._attributes)

    def spread(self, surface: Surface, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """The values themselves: the samples are the vertices."""
        return values

    def carry(self, surface: Surface, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """The values themselves."""
        return values

    def balance(self, costs: NDArray[np.float64], surface: Surface, unseen: float) -> NDArray[np.float64]:
        """The costs themselves: every member has as many samples as the mesh has vertices."""
        return costs

    def render(self, surface: Surface) -> NDArray[np.float32]:
        """Radial distances (height, width) [m] of a population of one in the camera's image, infinite beside it."""
        return self._raster.render(surface.vertices[0])

    def _sight(self, surface: Surface) -> NDArray[np.float64]:
        """Lines of sight (3, n) from the camera to the vertices of a population of one [m]."""
        return surface.vertices[0] - self.camera.center[:, None]


@kernel
def _synthesize(
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
    hidden: NDArray[np.bool_],
    pose: NDArray[np.float32],
    matrix: NDArray[np.float32],
    lens: NDArray[np.float32],
    limit: float,
    height: int,
    width: int,
    pixel: NDArray[np.int32],
    distance: NDArray[np.float32],
) -> None:
    """Eqs. 10, 11 and 20 for a population; as in `SparseView` and `Synthesis`, pose (3, 4) = T_sr, limit of r².

    A pixel's line of sight d, beside the vertex's by Δ, meets the tangential plane at z (1 − n · Δ / (n · d)).
    """
    zero, half, one, two = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2)
    fx, fy, cx, cy = matrix
    k1, k2, p1, p2, k3, k4, k5, k6 = lens
    stride = width + 2
    per_fx, per_fy, flattest = one / fx, one / fy, np.float32(-LEAST_COSINE)
    columns, rows, farthest = np.float32(width), np.float32(height), np.float32(limit)
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
            inside = column >= 0 and column < columns and row >= 0 and row < rows
            seen = facing and z > np.float32(1e-6) and r2 < farthest and inside
            place = (np.int32(row) + 1) * stride + np.int32(column) + 1 if seen else 0
            pixel[k, v] = -1 if hidden[v] else place
            right = (np.float32(np.int32(column)) + half - column) * per_fx if seen else zero
            down = (np.float32(np.int32(row)) + half - row) * per_fy if seen else zero
            u, w = u + right, w + down
            length = np.sqrt(u * u + w * w + one)
            along = min(nx * u + ny * w + nz, flattest * length)
            distance[k, v] = abs(z) * length * (one - (nx * right + ny * down) / along)


@kernel
def _synthesize_pinhole(
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
    hidden: NDArray[np.bool_],
    pose: NDArray[np.float32],
    matrix: NDArray[np.float32],
    lens: NDArray[np.float32],
    limit: float,
    height: int,
    width: int,
    pixel: NDArray[np.int32],
    distance: NDArray[np.float32],
) -> None:
    """Eqs. 11, 12 and 20: what `_synthesize` is without distortion, whose coefficients are ignored."""
    zero, half, one = np.float32(0), np.float32(0.5), np.float32(1)
    fx, fy, cx, cy = matrix
    stride = width + 2
    per_fx, per_fy, flattest = one / fx, one / fy, np.float32(-LEAST_COSINE)
    columns, rows, farthest = np.float32(width), np.float32(height), np.float32(limit)
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
            column = fx * u + cx + half
            row = fy * w + cy + half
            inside = column >= 0 and column < columns and row >= 0 and row < rows
            seen = facing and z > np.float32(1e-6) and r2 < farthest and inside
            place = (np.int32(row) + 1) * stride + np.int32(column) + 1 if seen else 0
            pixel[k, v] = -1 if hidden[v] else place
            right = (np.float32(np.int32(column)) + half - column) * per_fx if seen else zero
            down = (np.float32(np.int32(row)) + half - row) * per_fy if seen else zero
            u, w = u + right, w + down
            length = np.sqrt(u * u + w * w + one)
            along = min(nx * u + ny * w + nz, flattest * length)
            distance[k, v] = abs(z) * length * (one - (nx * right + ny * down) / along)
