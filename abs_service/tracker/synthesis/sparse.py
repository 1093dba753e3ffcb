"""Sparse direct synthesis: one value per vertex (section 3.1), forward distortion, compared in the input domain."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Window
from abs_service.pairing.observation import Observation
from abs_service.tracker.memo import Memo
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.synthesis.attribute_gradients import (
    CONSTANT,
    AttributeGradients,
    FirstOrder,
    ImageGradients,
    half_pixel,
    surroundings,
)
from abs_service.tracker.synthesis.base import AS_MEASURED, Resampling, Synthesis, View, once
from abs_service.tracker.synthesis.projection import Optics, Projection
from abs_service.tracker.synthesis.rasterization.raster import Raster
from abs_service.tracker.synthesis.window import around
from calib.camera import Camera
from calib.jit import kernel
from calib.rig import Rig

#: Self-occlusion: a vertex is occluded if the rendered mesh is nearer to the camera by more than this [m].
HIDING_M = 0.01


@dataclass(frozen=True)
class Settings:
    """Sparse direct synthesis has no keys."""

    def build(self, rig: Rig, mesh: Mesh) -> "Sparse":
        """The synthesis of a mesh for the sensors of a rig."""
        return Sparse(rig, mesh)


class Sparse:
    """Projects the vertices into the sensors' own images, which are not resampled.

    Attributes:
        canvas: the vertices and their surroundings.
        resamples: false.
    """

    resamples = False

    def __init__(self, rig: Rig, mesh: Mesh):
        self._step_m = half_pixel(rig, mesh)
        self.canvas = surroundings(mesh, self._step_m)
        self._rig = rig
        self._projections = {name: Projection(one.camera) for name, one in rig.sensors.items()}
        self._mesh = mesh

    def observe(self, observation: Observation) -> Resampling:
        """The images are compared as they were measured."""
        return AS_MEASURED

    def view(self, sensor: str, attributes: NDArray[np.float32]) -> View:
        """View of the vertices with attributes of the canvas in one sensor's camera.

        Attributes of the vertices alone (n, channels) are taken as constant around each vertex.
        """
        camera, n = self._rig.sensors[sensor].camera, len(self._mesh.vertices)
        if len(attributes) != len(self.canvas.vertices):
            return SparseView(camera, self._mesh.faces, attributes)
        return SparseView(
            camera, self._mesh.faces, attributes[:n], FirstOrder(camera, self._mesh, attributes[n:], self._step_m)
        )

    def window(self, sensor: str, predicted: Surface, reach_m: float) -> Window:
        """The window around the surface, see `window.around`."""
        return around(self._rig.sensors[sensor].camera, self._projections[sensor], predicted, reach_m)


class SparseView:
    """Projection of the vertices of a mesh into one camera."""

    def __init__(
        self,
        camera: Camera,
        faces: NDArray[np.int32],
        attributes: NDArray[np.float32],
        gradients: AttributeGradients = CONSTANT,
    ):
        self.camera = camera
        self._raster = Raster(camera, faces)
        self._attributes = np.ascontiguousarray(attributes.T, np.float32)
        self._gradients = gradients
        self._sampling = Sampling(gradients.sampler(camera.lens), Optics.of(camera))

    def observe(self, predicted: Surface) -> "ObservedSparseView":
        """The view without the vertices that face away or are self-occluded in the predicted mesh."""
        return self._observe(predicted, partial(self._raster.render_at, predicted.vertices[0]))

    def observe_rendered(self, predicted: Surface) -> tuple["ObservedSparseView", NDArray[np.float32]]:
        """`observe` and `render` of the predicted mesh."""
        distance = self.render(predicted)
        return self._observe(predicted, lambda rows, columns: distance[rows, columns]), distance

    def _observe(
        self, predicted: Surface, front_at: Callable[[NDArray[np.intp], NDArray[np.intp]], NDArray[np.float32]]
    ) -> "ObservedSparseView":
        """See `observe`; `front_at` tells the distances (k,) [m] of the predicted mesh at rows and columns (k,)."""
        view = self.unoccluded(predicted)
        seen = view.synthesize(predicted)
        pixel, distance, stride = seen.pixel[0], seen.distance[0], self.camera.width + 2
        rows, columns = np.divmod(np.maximum(pixel - (stride + 1), 0), stride)
        front, hidden = front_at(rows, columns), np.empty_like(view.hidden)
        hide(predicted.vertices[0], predicted.normals[0], self.camera.center, front, distance, pixel, hidden)
        return ObservedSparseView(self.camera, self._sampling, self._attributes, view.gradients, hidden)

    def unoccluded(self, predicted: Surface) -> "ObservedSparseView":
        """The view of all vertices, whatever may be before them."""
        hidden = np.zeros(predicted.vertices.shape[2], np.bool_)
        return ObservedSparseView(
            self.camera, self._sampling, self._attributes, self._gradients.observe(predicted), hidden
        )

    def render(self, surface: Surface) -> NDArray[np.float32]:
        """Radial distances (height, width) [m] of a population of one in the camera's image; infinite off the mesh."""
        return self._raster.render(surface.vertices[0])


class Sampling(NamedTuple):
    """The projection of vertices to samples.

    Attributes:
        kernel: of `AttributeGradients.sampler`.
        optics: of the camera.
    """

    kernel: Callable[..., None]
    optics: Optics


@dataclass(frozen=True, slots=True, eq=False)
class ObservedSparseView:
    """The vertices of a mesh in one camera, in one frame.

    Attributes:
        camera: the camera.
        sampling: the projection of the vertices.
        attributes: of the vertices (channels, n).
        gradients: of the attributes in the image.
        hidden: vertices (n,) that are no samples.
        single: syntheses of populations of one, see `once`.
    """

    camera: Camera
    sampling: Sampling
    attributes: NDArray[np.float32]
    gradients: ImageGradients
    hidden: NDArray[np.bool_]
    single: Memo[Surface, Synthesis] = field(init=False, default_factory=Memo[Surface, Synthesis])

    def synthesize(self, surface: Surface) -> Synthesis:
        """Synthesises a population of deformed meshes; a surface by itself once."""
        return once(self.single, surface, self._synthesize)

    def _synthesize(self, surface: Surface) -> Synthesis:
        population, _, n = surface.vertices.shape
        pixel = np.empty((population, n), np.int32)
        distance = np.empty((population, n), np.float32)
        steps = self.gradients.steps(population, n)
        kernel, optics = self.sampling
        kernel(surface.vertices, surface.normals, self.hidden, optics, pixel, distance, steps)
        return Synthesis(pixel, distance, self.gradients.at_centers(self.attributes, steps), AT_VERTICES)

    def attribute_gradients(self, seen: Synthesis) -> NDArray[np.float32]:
        """Gradients for the predicted surface."""
        return self.gradients.per_pixel(self.attributes)


class AtVertices:
    """The samples are the vertices: every value is its own."""

    def spread(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """The values themselves."""
        return values

    def follow(self, sparse_jacobian: SparseJacobian) -> SparseJacobian:
        """The Jacobian itself."""
        return sparse_jacobian

    def carry(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """The values themselves."""
        return values

    def balance(self, costs: NDArray[np.float64], unseen: float) -> NDArray[np.float64]:
        """The costs themselves: every candidate has one sample per vertex."""
        return costs


AT_VERTICES = AtVertices()


@kernel
def hide(
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
    center: NDArray[np.float64],
    front: NDArray[np.float32],
    distance: NDArray[np.float32],
    pixel: NDArray[np.int32],
    hidden: NDArray[np.bool_],
) -> None:
    """Marks vertices (3, n) [m] that face away from a camera's centre (3,), or in front of which the mesh itself lies.

    Args:
        vertices, normals: of the surface (3, n).
        center: of the camera [m].
        front, distance: of the rendered mesh at the vertices' pixels, and of the vertices (n,) [m].
        pixel: not above 0 where the camera does not see the vertex (n,).
        hidden: result (n,).
    """
    for v in range(hidden.size):
        along = 0.0
        for i in range(3):
            along += normals[i, v] * (np.float64(vertices[i, v]) - center[i])
        hidden[v] = not along < 0 or (pixel[v] > 0 and front[v] < distance[v] - np.float32(HIDING_M))
