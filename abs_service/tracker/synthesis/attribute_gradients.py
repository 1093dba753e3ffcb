"""What the surface looks like around its vertices, to first order, so that it can be compared at centres of pixels."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.centers import at_centers, at_centers_fisheye
from abs_service.tracker.synthesis.perspective import metres_per_pixel
from abs_service.tracker.synthesis.projection import optics
from calib.camera import Camera
from calib.fisheye import KannalaBrandt
from calib.rig import ImageNoise, Rig


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
        if isinstance(sensor.noise, ImageNoise) and len(mesh.vertices)
    ]
    return float(0.5 * min((size for size in sizes if size > 0), default=2e-3))


class AttributeGradients(Protocol):
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


class Constant:
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


CONSTANT = Constant()


class FirstOrder:
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
        self._optics = *optics(camera), camera.width + 2
        self._is_fisheye = isinstance(camera.lens, KannalaBrandt)

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
        to_centers = at_centers_fisheye if self._is_fisheye else at_centers
        to_centers(surface.vertices, pixel, *self._optics, values, self._per_pixel, result)
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
