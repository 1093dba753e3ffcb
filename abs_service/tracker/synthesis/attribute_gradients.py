"""First-order expansion of the attributes around the vertices, evaluated at pixel centres."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.centers import at_centers
from abs_service.tracker.synthesis.perspective import image_gradients
from abs_service.tracker.synthesis.sampling import sampler, stepping_sampler
from calib.camera import Camera
from calib.lenses.lens import LensModel
from calib.noise.base import ImageNoise
from calib.rig import Rig


def surroundings(mesh: Mesh, step_m: float) -> Mesh:
    """The vertices, and four points in the tangent plane of each: at ±step along two directions.

    Args:
        mesh: with n vertices.
        step_m: distance from a vertex to its four points [m].

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
    """Half a pixel's footprint on the mesh in the image sensor of the finest resolution [m]; 1 mm without one."""
    sizes = [
        np.median((mesh.vertices - sensor.camera.center) @ sensor.camera.T_rs[:3, 2]) / sensor.camera.fx
        for sensor in rig.sensors.values()
        if isinstance(sensor.noise, ImageNoise) and len(mesh.vertices)
    ]
    return float(0.5 * min((size for size in sizes if size > 0), default=2e-3))


class ImageGradients(Protocol):
    """Gradients of the attributes at the vertices in one camera's image, for the predicted surface of a frame."""

    def steps(self, population: int, vertices: int) -> NDArray[np.float32]:
        """Memory for the steps that the kernel writes, see `AttributeGradients.sampler`."""
        ...

    def per_pixel(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Derivatives to the right and down [1/px] (n, channels, 2), for values (channels, n); NaN where unknown."""
        ...

    def at_centers(self, values: NDArray[np.float32], steps: NDArray[np.float32]) -> NDArray[np.float32]:
        """Attributes (population or 1, channels, n) at the centres of the pixels into which the vertices project.

        Args:
            values: attributes of the vertices (channels, n).
            steps: as the kernel has written them.
        """
        ...


class AttributeGradients(Protocol):
    """Gradients of the attributes along the surface."""

    def sampler(self, lens: LensModel) -> Callable[..., None]:
        """Kernel that synthesises the inputs of `ImageGradients.at_centers`, see `sampling`."""
        ...

    def observe(self, predicted: Surface) -> ImageGradients:
        """The gradients in the image, for the predicted surface of a frame, a population of one."""
        ...


class Constant:
    """Attributes that are constant around a vertex, where the gradients are unknown, in every frame alike."""

    def sampler(self, lens: LensModel) -> Callable[..., None]:
        """The kernel without steps."""
        return sampler(lens)

    def observe(self, predicted: Surface) -> "Constant":
        """Itself: the values do not depend on the pose of the surface."""
        return self

    def steps(self, population: int, vertices: int) -> NDArray[np.float32]:
        """No memory: the kernel writes no steps."""
        return np.empty((2, 0, 0), np.float32)

    def per_pixel(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """NaN (n, channels, 2): an unknown gradient is not a gradient of zero."""
        return np.full((*values.T.shape, 2), np.nan, np.float32)

    def at_centers(self, values: NDArray[np.float32], steps: NDArray[np.float32]) -> NDArray[np.float32]:
        """The values themselves (1, channels, n)."""
        return values[None]


CONSTANT = Constant()


class FirstOrder:
    """First-order expansion of the attributes around the vertices.

    A measurement belongs to the centre of a pixel, up to half a pixel away from the vertex (eq. 20). For a texture with
    details of the size of a pixel, this rounding would be the largest error.
    """

    def __init__(self, camera: Camera, mesh: Mesh, beside: NDArray[np.float32], step_m: float):
        """Takes in `beside` the attributes of the last four fifths of the `surroundings` (4 n, channels)."""
        steps = beside.reshape(4, len(mesh.vertices), -1).astype(np.float64)
        change = np.stack([steps[0] - steps[1], steps[2] - steps[3]], axis=-1)
        self._per_metre = np.nan_to_num(change / (2 * step_m))
        self._camera = camera
        self._edges = mesh.edges
        self._lengths = _along(mesh, self._edges)

    def sampler(self, lens: LensModel) -> Callable[..., None]:
        """The kernel with steps."""
        return stepping_sampler(lens)

    def observe(self, predicted: Surface) -> "FirstOrderInImage":
        """The gradients in the image for the predicted surface, a population of one.

        Tangents deform with the surface, so their directions in the image follow from the edges around a vertex.
        """
        vertices = predicted.vertices[0].T
        gradients = image_gradients(self._camera, vertices, self._edges, self._lengths, self._per_metre)
        return FirstOrderInImage(gradients, np.ascontiguousarray(gradients.transpose(1, 2, 0)))


@dataclass(frozen=True, slots=True, eq=False)
class FirstOrderInImage:
    """The first-order expansion in the image of one frame, see `ImageGradients`.

    Attributes:
        gradients: of the attributes (n, channels, 2) [1/px]; 0 at vertices whose surroundings were not visible.
        planes: the gradients as the kernel reads them (channels, 2, n).
    """

    gradients: NDArray[np.float32]
    planes: NDArray[np.float32]

    def steps(self, population: int, vertices: int) -> NDArray[np.float32]:
        """Memory (2, population, n)."""
        return np.empty((2, population, vertices), np.float32)

    def per_pixel(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """The gradients."""
        return self.gradients

    def at_centers(self, values: NDArray[np.float32], steps: NDArray[np.float32]) -> NDArray[np.float32]:
        """Value + gradient · (centre of the pixel − projection of the vertex) (population, channels, n)."""
        result = np.empty((steps.shape[1], *values.shape), np.float32)
        at_centers(steps, values, self.planes, result)
        return result


def _tangents(mesh: Mesh) -> NDArray[np.float64]:
    """Orthonormal tangents (n, 2, 3) at each vertex; first × second = normal."""
    normals = mesh.normals
    least = np.argmin(np.abs(normals), axis=1)
    axis = np.eye(3)[least] - normals * normals[np.arange(len(normals)), least][:, None]
    first = axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-12)
    return np.stack([first, np.cross(normals, first).astype(np.float64)], axis=1)


def _along(mesh: Mesh, edges: NDArray[np.int32]) -> NDArray[np.float64]:
    """Components of every edge in the tangent planes of both its ends (2, k, 2) [m]."""
    tangents, (first, second) = _tangents(mesh), edges.T
    edge = mesh.vertices[second] - mesh.vertices[first]
    return np.stack([np.einsum("kij,kj->ki", tangents[end], edge) for end in (first, second)])
