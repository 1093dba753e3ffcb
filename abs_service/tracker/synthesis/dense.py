"""Dense synthesis: the mesh is rendered into every image, forward distortion included, and compared per pixel."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from abs_service.pairing.images import Window
from abs_service.pairing.observation import Observation
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.synthesis.base import Synthesis, View
from abs_service.tracker.synthesis.projection import Projection, in_sight
from abs_service.tracker.synthesis.rasterization.raster import Raster
from abs_service.tracker.synthesis.rasterization.texturing import lattice, paint
from abs_service.tracker.synthesis.rasterization.zbuffer import Samples, interpolate, render
from abs_service.tracker.synthesis.window import around
from calib.camera import Camera
from calib.rig import Rig


@dataclass(frozen=True)
class Settings:
    """TOML keys of the dense synthesis.

    Attributes:
        step: spacing of the compared pixels in rows and columns [px].
        detail: number of subdivisions of every mesh edge at which the appearance is sampled.
    """

    step: Annotated[int, Interval(ge=1, le=16)] = 1
    detail: Annotated[int, Interval(ge=1, le=16)] = 4

    def build(self, rig: Rig, mesh: Mesh) -> "Dense":
        """The synthesis of a mesh for the sensors of a rig."""
        return Dense(rig, mesh, self.step, self.detail)


#: Lower bound of the share of the predicted mesh in the image by which its number of pixels is divided.
MIN_SHARE = 0.1

#: Samples of an empty population.
_NONE = Samples(
    np.zeros((0, 0), np.int32),
    np.zeros((0, 0), np.float32),
    np.zeros((0, 0), np.int32),
    np.zeros((0, 0, 3), np.float32),
    np.zeros(0, np.int64),
)


class Dense:
    """Renders into the sensors' own images, which are not resampled.

    Attributes:
        canvas: lattice points at which the appearance is sampled.
        resamples: false.
    """

    resamples = False

    def __init__(self, rig: Rig, mesh: Mesh, step: int, detail: int):
        self.canvas = lattice(mesh, detail)
        self._rig = rig
        self._projections = {name: Projection(one.camera) for name, one in rig.sensors.items()}
        self._mesh = mesh
        self._step = step
        self._detail = detail

    def observe(self, observation: Observation) -> None:
        """No effect: the views do not depend on the images."""

    def view(self, sensor: str, attributes: NDArray[np.float32]) -> View:
        """View of the mesh with attributes of the lattice (k, channels) in one sensor's camera."""
        camera = self._rig.sensors[sensor].camera
        return DenseView(camera, self._mesh.faces, attributes, self._step, self._detail)

    def window(self, sensor: str, predicted: Surface, reach_m: float) -> Window:
        """The window around the surface, see `window.around`."""
        return around(self._rig.sensors[sensor].camera, self._projections[sensor], predicted, reach_m)

    def texture(self, sensor: str, texture: NDArray[np.float32]) -> NDArray[np.float32]:
        """The texture itself."""
        return texture

    def image(self, sensor: str, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """The image itself."""
        return image


class DenseView:
    """The pixels that a mesh covers in one camera's image."""

    def __init__(
        self, camera: Camera, faces: NDArray[np.int32], attributes: NDArray[np.float32], step: int, detail: int
    ):
        self.camera = camera
        self._faces = np.ascontiguousarray(faces, np.int32)
        self._attributes = np.ascontiguousarray(attributes, np.float32)
        self._raster = Raster(camera, faces)
        self._step = step
        self._detail = detail
        self._projection = Projection(camera)
        self._ray_length = camera.lookup.ray_length.astype(np.float32)
        self._expected = 0.0
        self._last: tuple[Surface | None, Samples, NDArray[np.float64]] = (None, _NONE, np.zeros(0))

    def look(self, predicted: Surface) -> None:
        """Counts the pixels of the predicted mesh; the z-buffer resolves self-occlusion per candidate."""
        samples, share = self._render(predicted)
        self._expected = float(samples.covered[0]) / max(float(share[0]), MIN_SHARE)

    def synthesize(self, surface: Surface) -> Synthesis:
        """Synthesises a population; samples beyond a candidate's number of covered pixels have pixel −1."""
        samples, _ = self._render(surface)
        return Synthesis(samples.pixel, samples.distance, paint(self._attributes, self._detail, samples))

    def attribute_gradients(self, surface: Surface) -> NDArray[np.float32]:
        """NaN: gradients of the image are more accurate than those of the lattice."""
        samples, _ = self._render(surface)
        return np.full((samples.pixel.shape[1], self._attributes.shape[1], 2), np.nan, np.float32)

    def gradient_noise_gains(self, surface: Surface) -> NDArray[np.float64]:
        """Zeros: no gradients are known."""
        return np.zeros((self._render(surface)[0].pixel.shape[1], 2))

    def spread(self, surface: Surface, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values (n, …) of the vertices, interpolated at the samples (m, …) of a population of one."""
        samples, _ = self._render(surface)
        return np.einsum("mi,mi...->m...", samples.weights[0], values[self._faces[samples.face[0]]])

    def follow(self, surface: Surface, sparse_jacobian: SparseJacobian) -> SparseJacobian:
        """Jacobian of the samples, interpolated from that of the vertices."""
        return SparseJacobian.from_dense(self.spread(surface, sparse_jacobian.dense))

    def carry(self, surface: Surface, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Values (population, n) of the vertices, interpolated at the samples (population, m)."""
        return interpolate(values[..., None], self._faces, self._render(surface)[0])[..., 0]

    def balance(self, costs: NDArray[np.float64], surface: Surface, unseen: float) -> NDArray[np.float64]:
        """Mean cost of a candidate's pixels times the predicted number of pixels, for the share of it in the image.

        The rim of the mesh comes from the initial detection and need not be the rim of the object, so a candidate that
        covers more pixels is not a better fit. The covered area does not change the cost; leaving the image increases
        it.
        """
        samples, share = self._render(surface)
        mean = np.where(samples.covered > 0, costs / np.maximum(samples.covered, 1), unseen)
        return self._expected * (share * mean + (1 - share) * unseen)

    def render(self, surface: Surface) -> NDArray[np.float32]:
        """Radial distances (height, width) [m] of a population of one in the camera's image; infinite off the mesh."""
        return self._raster.render(surface.vertices[0])

    def _render(self, surface: Surface) -> tuple[Samples, NDArray[np.float64]]:
        """The covered pixels of a population, and the share (population,) of its vertices that lie in the image.

        The result for the last population is cached.
        """
        last, samples, share = self._last
        if last is not surface:
            projected = self._projection.project(surface.vertices)
            share = in_sight(projected, self._ray_length.shape)
            samples = render(projected, self._faces, self._ray_length, self._step)
            self._last = (surface, samples, share)
        return samples, share
