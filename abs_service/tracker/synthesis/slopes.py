"""What the surface looks like around its vertices, to first order, so that it can be compared at centres of pixels."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.perspective import metres_per_pixel
from calib.camera import Camera
from calib.fisheye import KannalaBrandt
from calib.forward import bend_fisheye
from calib.jit import kernel, prange
from calib.rig import PictureNoise, Rig


def surroundings(mesh: Mesh, step_m: float) -> Mesh:
    """The vertices, and beside each four points of its tangential plane: at ±step along two directions.

    Args:
        mesh: with n vertices.
        step_m: from a vertex to its four points [m].

    Returns:
        A mesh with 5 n vertices: all vertices, then all points at +step along the first direction, at −step, and
        likewise along the second. Its normals are those of the vertices; its colours are unknown.
    """
    n = len(mesh.vertices)
    tangents = _tangents(mesh)
    first, second = step_m * tangents[:, 0], step_m * tangents[:, 1]
    shifts = np.concatenate([0 * first, first, -first, second, -second])
    own = np.arange(n)[:, None]
    turns = [(1, 3), (3, 2), (2, 4), (4, 1)]
    faces = np.concatenate([own + n * np.array([0, a, b]) for a, b in turns]).astype(np.int32)
    unknown = np.full((5 * n, 3), np.nan, np.float32)
    return Mesh(np.tile(mesh.vertices, (5, 1)) + shifts, faces, unknown, np.tile(mesh.chart, (5, 1)))


def half_pixel(rig: Rig, mesh: Mesh) -> float:
    """Half a pixel of the sensor that shows the mesh in the finest picture [m]; a millimetre if there is none."""
    sizes = [
        np.median((mesh.vertices - sensor.camera.center) @ sensor.camera.T_rs[:3, 2]) / sensor.camera.fx
        for sensor in rig.sensors.values()
        if isinstance(sensor.noise, PictureNoise) and len(mesh.vertices)
    ]
    return float(0.5 * min((size for size in sizes if size > 0), default=2e-3))


class Slopes(Protocol):
    """How the appearance changes around the vertices in one camera's image."""

    def per_pixel(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """To the right and down (n, channels, 2), for values (n, channels); NaN where it is not known."""
        ...

    def look(self, predicted: Surface) -> None:
        """Takes where the surface, a population of one, is expected in this frame."""
        ...

    def at_centers(
        self, values: NDArray[np.float32], surface: Surface, pixel: NDArray[np.int32]
    ) -> NDArray[np.float32]:
        """What a population looks like at the centres of the pixels (population, n) that its vertices meet.

        Args:
            values: what the vertices look like (n, channels).
            surface: the population.
            pixel: as in `Synthesis`.

        Returns:
            (population or 1, n, channels).
        """
        ...


class Level:
    """Around a vertex everything is taken to look like the vertex, for want of anything better."""

    def per_pixel(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """NaN (n, channels, 2): what is not known is not said to be level."""
        return np.full((*values.shape, 2), np.nan, np.float32)

    def look(self, predicted: Surface) -> None:
        """Nothing depends on where the surface is."""

    def at_centers(
        self, values: NDArray[np.float32], surface: Surface, pixel: NDArray[np.int32]
    ) -> NDArray[np.float32]:
        """The values themselves (1, n, channels)."""
        return values[None]


LEVEL = Level()


class Relief:
    """The first order of what the surroundings of the vertices look like.

    A measurement belongs to the centre of a pixel, up to half a pixel away from the vertex (eq. 20). In a texture with
    details of the size of a pixel that would be the largest error there is.
    """

    def __init__(self, camera: Camera, mesh: Mesh, beside: NDArray[np.float32], step_m: float):
        """`beside` are the attributes of the last four fifths of the `surroundings` (4 n, channels)."""
        steps = beside.reshape(4, len(mesh.vertices), -1).astype(np.float64)
        change = np.stack([steps[0] - steps[1], steps[2] - steps[3]], axis=-1)
        self._per_metre = np.nan_to_num(change / (2 * step_m))
        self._per_pixel = np.zeros(change.shape, np.float32)
        self._camera = camera
        self._edges = mesh.edges
        self._lengths = _along(mesh, self._edges)
        self._pose = np.ascontiguousarray(camera.T_sr[:3], np.float32)
        self._matrix = np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32)
        self._lens = camera.lens.coefficients.astype(np.float32)
        self._kernel = _at_centers_fisheye if isinstance(camera.lens, KannalaBrandt) else _at_centers

    def per_pixel(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """As last looked; 0 at vertices whose surroundings were not seen."""
        return self._per_pixel

    def look(self, predicted: Surface) -> None:
        """Finds how the appearance changes in the image where the surface, a population of one, is expected.

        The deformation takes tangents along, so the edges around a vertex tell where they point in the image.
        """
        flat = metres_per_pixel(self._camera, predicted.vertices[0].T, self._edges, self._lengths)
        self._per_pixel = np.ascontiguousarray(self._per_metre @ flat, np.float32)

    def at_centers(
        self, values: NDArray[np.float32], surface: Surface, pixel: NDArray[np.int32]
    ) -> NDArray[np.float32]:
        """Value + slope · (centre of the pixel − projection of the vertex) (population, n, channels)."""
        result = np.empty((*pixel.shape, values.shape[1]), np.float32)
        where = (self._pose, self._matrix, self._lens, self._camera.width + 2)
        self._kernel(surface.vertices, pixel, *where, values, self._per_pixel, result)
        return result


def _tangents(mesh: Mesh) -> NDArray[np.float64]:
    """Two unit vectors (n, 2, 3) that are orthogonal to each vertex's normal and to each other; first × second = it."""
    normals = mesh.normals
    least = np.argmin(np.abs(normals), axis=1)
    axis = np.eye(3)[least] - normals * normals[np.arange(len(normals)), least][:, None]
    first = axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-12)
    return np.stack([first, np.cross(normals, first).astype(np.float64)], axis=1)


def _along(mesh: Mesh, edges: NDArray[np.int32]) -> NDArray[np.float64]:
    """Every edge in the tangential planes of both its ends (2, k, 2) [m]."""
    tangents, (first, second) = _tangents(mesh), edges.T
    edge = mesh.vertices[second] - mesh.vertices[first]
    return np.stack([np.einsum("kij,kj->ki", tangents[end], edge) for end in (first, second)])


@kernel
def _at_centers(
    vertices: NDArray[np.float32],
    pixel: NDArray[np.int32],
    pose: NDArray[np.float32],
    matrix: NDArray[np.float32],
    lens: NDArray[np.float32],
    stride: int,
    values: NDArray[np.float32],
    slopes: NDArray[np.float32],
    result: NDArray[np.float32],
) -> None:
    """Value + slope · (centre of the pixel − projection of the vertex), eq. 10; the value itself in the border."""
    one, two, width, per_stride = np.float32(1), np.float32(2), np.int32(stride), 1 / stride
    fx, fy, cx, cy = matrix
    k1, k2, p1, p2, k3, k4, k5, k6 = lens
    for k in prange(pixel.shape[0]):
        rights, downs = np.empty(pixel.shape[1], np.float32), np.empty(pixel.shape[1], np.float32)
        for v in range(pixel.shape[1]):
            right, down = np.float32(0), np.float32(0)
            if pixel[k, v] > 0:
                a, b, c = vertices[k, 0, v], vertices[k, 1, v], vertices[k, 2, v]
                inverse = one / (pose[2, 0] * a + pose[2, 1] * b + pose[2, 2] * c + pose[2, 3])
                x = (pose[0, 0] * a + pose[0, 1] * b + pose[0, 2] * c + pose[0, 3]) * inverse
                y = (pose[1, 0] * a + pose[1, 1] * b + pose[1, 2] * c + pose[1, 3]) * inverse
                r2 = x * x + y * y
                radial = (one + r2 * (k1 + r2 * (k2 + r2 * k3))) / (one + r2 * (k4 + r2 * (k5 + r2 * k6)))
                column = fx * (x * radial + two * p1 * x * y + p2 * (r2 + two * x * x)) + cx
                row = fy * (y * radial + p1 * (r2 + two * y * y) + two * p2 * x * y) + cy
                line = np.int32((pixel[k, v] + 0.5) * per_stride)  # divisions of integers take as long as all of this
                right = np.float32(pixel[k, v] - line * width) - one - column
                down = np.float32(line) - one - row
            rights[v], downs[v] = right, down
        for channel in range(values.shape[1]):
            own, slope, looks = values[:, channel], slopes[:, channel], result[k, :, channel]
            for v in range(np.uintp(looks.size)):
                looks[v] = own[v] + slope[v, 0] * rights[v] + slope[v, 1] * downs[v]


@kernel
def _at_centers_fisheye(
    vertices: NDArray[np.float32],
    pixel: NDArray[np.int32],
    pose: NDArray[np.float32],
    matrix: NDArray[np.float32],
    lens: NDArray[np.float32],
    stride: int,
    values: NDArray[np.float32],
    slopes: NDArray[np.float32],
    result: NDArray[np.float32],
) -> None:
    """What `_at_centers` is with the four coefficients of a fisheye."""
    one, width, per_stride = np.float32(1), np.int32(stride), 1 / stride
    fx, fy, cx, cy = matrix
    for k in prange(pixel.shape[0]):
        rights, downs = np.empty(pixel.shape[1], np.float32), np.empty(pixel.shape[1], np.float32)
        for v in range(pixel.shape[1]):
            right, down = np.float32(0), np.float32(0)
            if pixel[k, v] > 0:
                a, b, c = vertices[k, 0, v], vertices[k, 1, v], vertices[k, 2, v]
                inverse = one / (pose[2, 0] * a + pose[2, 1] * b + pose[2, 2] * c + pose[2, 3])
                x = (pose[0, 0] * a + pose[0, 1] * b + pose[0, 2] * c + pose[0, 3]) * inverse
                y = (pose[1, 0] * a + pose[1, 1] * b + pose[1, 2] * c + pose[1, 3]) * inverse
                bent_x, bent_y = bend_fisheye(x, y, lens)
                column = fx * bent_x + cx
                row = fy * bent_y + cy
                line = np.int32((pixel[k, v] + 0.5) * per_stride)  # divisions of integers take as long as all of this
                right = np.float32(pixel[k, v] - line * width) - one - column
                down = np.float32(line) - one - row
            rights[v], downs[v] = right, down
        for channel in range(values.shape[1]):
            own, slope, looks = values[:, channel], slopes[:, channel], result[k, :, channel]
            for v in range(np.uintp(looks.size)):
                looks[v] = own[v] + slope[v, 0] * rights[v] + slope[v, 1] * downs[v]
