"""Sparse direct synthesis: one value per vertex (section 3.1), forward distortion, compared in the input domain."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Window
from abs_service.pairing.observation import Observation
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.synthesis.attribute_gradients import (
    CONSTANT,
    AttributeGradients,
    FirstOrder,
    half_pixel,
    surroundings,
)
from abs_service.tracker.synthesis.base import Synthesis, View
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

    def observe(self, observation: Observation) -> None:
        """No effect: the views do not depend on the images."""

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

    def texture(self, sensor: str, texture: NDArray[np.float32]) -> NDArray[np.float32]:
        """The texture itself."""
        return texture

    def image(self, sensor: str, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """The image itself."""
        return image


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
        self._hidden = np.zeros(len(attributes), np.bool_)
        self._rendered: tuple[Surface | None, NDArray[np.float32]] = (None, np.zeros((0, 0), np.float32))
        self._seen: dict[Surface, Synthesis] = {}  # in this frame, without populations
        self._optics = Optics.of(camera)
        self._sample = gradients.sampler(camera.lens)

    def look(self, predicted: Surface) -> None:
        """Marks the vertices that face away or are self-occluded in the predicted mesh."""
        self._hidden, self._seen = np.zeros(predicted.vertices.shape[2], np.bool_), {}
        self._gradients.look(predicted)
        seen = self._synthesize(predicted)
        pixel, hidden = seen.pixel[0], np.empty_like(self._hidden)
        hide(
            predicted.vertices[0],
            predicted.normals[0],
            self.camera.center,
            self._front(predicted, pixel),
            seen.distance[0],
            pixel,
            hidden,
        )
        self._hidden = hidden

    def synthesize(self, surface: Surface) -> Synthesis:
        """Synthesises a population of deformed meshes; occluded vertices are ignored.

        A surface by itself is synthesised once in a frame.
        """
        if len(surface.vertices) > 1:
            return self._synthesize(surface)
        if surface not in self._seen:
            self._seen[surface] = self._synthesize(surface)
        return self._seen[surface]

    def _synthesize(self, surface: Surface) -> Synthesis:
        population, _, n = surface.vertices.shape
        pixel = np.empty((population, n), np.int32)
        distance = np.empty((population, n), np.float32)
        steps = self._gradients.steps(population, n)
        self._sample(surface.vertices, surface.normals, self._hidden, self._optics, pixel, distance, steps)
        return Synthesis(pixel, distance, self._gradients.at_centers(self._attributes, steps))

    def attribute_gradients(self, surface: Surface) -> NDArray[np.float32]:
        """Gradients for the predicted surface, see `look`."""
        return self._gradients.per_pixel(self._attributes)

    def gradient_noise_gains(self, surface: Surface) -> NDArray[np.float64]:
        """Their noise gains for the predicted surface, see `look`."""
        return self._gradients.noise_gains(surface.vertices.shape[2])

    def spread(self, surface: Surface, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """The values themselves: the samples are the vertices."""
        return values

    def follow(self, surface: Surface, sparse_jacobian: SparseJacobian) -> SparseJacobian:
        """The Jacobian itself: the samples are the vertices."""
        return sparse_jacobian

    def carry(self, surface: Surface, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """The values themselves: the samples are the vertices."""
        return values

    def balance(self, costs: NDArray[np.float64], surface: Surface, unseen: float) -> NDArray[np.float64]:
        """The costs themselves: every candidate has one sample per vertex."""
        return costs

    def render(self, surface: Surface) -> NDArray[np.float32]:
        """Radial distances (height, width) [m] of a population of one in the camera's image; infinite off the mesh.

        The result for the last surface is cached.
        """
        last, image = self._rendered
        if last is not surface:
            image = self._raster.render(surface.vertices[0])
            self._rendered = (surface, image)
        return image

    def _front(self, surface: Surface, pixel: NDArray[np.int32]) -> NDArray[np.float32]:
        """Radial distances (n,) [m] of `render` at pixels, see `Synthesis`; renders only those unless it is cached.

        Anything for samples that the camera does not see.
        """
        (last, image), stride = self._rendered, self.camera.width + 2
        rows, columns = np.divmod(np.maximum(pixel - (stride + 1), 0), stride)
        return image[rows, columns] if last is surface else self._raster.render_at(surface.vertices[0], rows, columns)


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
