"""Dense synthesis: the mesh is rendered into every image, forward distortion included, and compared per pixel."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from abs_service.pairing.images import Window
from abs_service.pairing.observation import Observation
from abs_service.tracker.memo import Memo
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.synthesis.base import AS_MEASURED, Resampling, Synthesis, View, once
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

    def observe(self, observation: Observation) -> Resampling:
        """The images are compared as they were measured."""
        return AS_MEASURED

    def view(self, sensor: str, attributes: NDArray[np.float32]) -> View:
        """View of the mesh with attributes of the lattice (k, channels) in one sensor's camera."""
        camera = self._rig.sensors[sensor].camera
        return DenseView(camera, self._mesh.faces, attributes, self._step, self._detail)

    def window(self, sensor: str, predicted: Surface, reach_m: float) -> Window:
        """The window around the surface, see `window.around`."""
        return around(self._rig.sensors[sensor].camera, self._projections[sensor], predicted, reach_m)


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

    def observe(self, predicted: Surface) -> "ObservedDenseView":
        """Counts the pixels of the predicted mesh; the z-buffer resolves self-occlusion per candidate."""
        samples, share = self._rasterize(predicted)
        expected = float(samples.covered[0]) / max(float(share[0]), MIN_SHARE)
        seen = self._painted(samples, share, expected)
        return ObservedDenseView(
            self.camera, lambda surface: self._painted(*self._rasterize(surface), expected), Memo({predicted: seen})
        )

    def render(self, surface: Surface) -> NDArray[np.float32]:
        """Radial distances (height, width) [m] of a population of one in the camera's image; infinite off the mesh."""
        return self._raster.render(surface.vertices[0])

    def observe_rendered(self, predicted: Surface) -> tuple["ObservedDenseView", NDArray[np.float32]]:
        """View of one frame and its rendered distances; see `observe` and `render`."""
        return self.observe(predicted), self.render(predicted)

    def _painted(self, samples: Samples, share: NDArray[np.float64], expected: float) -> Synthesis:
        """The synthesis of a rasterised population; `expected` is the number of pixels of the predicted mesh."""
        attributes = paint(self._attributes, self._detail, samples)
        return Synthesis(samples.pixel, samples.distance, attributes, InFaces(self._faces, samples, share, expected))

    def _rasterize(self, surface: Surface) -> tuple[Samples, NDArray[np.float64]]:
        """The covered pixels of a population, and the share (population,) of its vertices that lie in the image."""
        projected = self._projection.project(surface.vertices)
        samples = render(projected, self._faces, self._ray_length, self._step)
        return samples, in_sight(projected, self._ray_length.shape)


class ObservedDenseView:
    """The pixels that a mesh covers in one camera's image, in one frame.

    Args:
        camera: the camera.
        synthesize: synthesises a population.
        single: syntheses of populations of one, see `once`.
    """

    def __init__(self, camera: Camera, synthesize: Callable[[Surface], Synthesis], single: Memo[Surface, Synthesis]):
        self.camera = camera
        self._synthesize = synthesize
        self._single = single

    def synthesize(self, surface: Surface) -> Synthesis:
        """Synthesises a population, a surface by itself once.

        Samples beyond a candidate's number of covered pixels have pixel −1.
        """
        return once(self._single, surface, self._synthesize)

    def attribute_gradients(self, seen: Synthesis) -> NDArray[np.float32]:
        """NaN: gradients of the image are more accurate than those of the lattice."""
        return np.full((*seen.attributes[0].T.shape, 2), np.nan, np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class InFaces:
    """The samples lie in faces, see `Interpolation`.

    Attributes:
        faces: of the mesh (k, 3).
        samples: of a population.
        share: of the vertices of each candidate that lie in the image (population,).
        expected: number of pixels of the predicted mesh.
    """

    faces: NDArray[np.int32]
    samples: Samples
    share: NDArray[np.float64]
    expected: float

    def spread(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values (n, …) of the vertices, interpolated at the samples (m, …) of a population of one."""
        weights, corners = self.samples.weights[0], self.faces[self.samples.face[0]]
        return np.einsum("mi,mi...->m...", weights, values[corners])

    def follow(self, sparse_jacobian: SparseJacobian) -> SparseJacobian:
        """Jacobian of the samples, interpolated from that of the vertices."""
        return SparseJacobian.from_dense(self.spread(sparse_jacobian.dense))

    def carry(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Values (population, n) of the vertices, interpolated at the samples (population, m)."""
        return interpolate(values[..., None], self.faces, self.samples)[..., 0]

    def balance(self, costs: NDArray[np.float64], unseen: float) -> NDArray[np.float64]:
        """Mean cost of a candidate's pixels times the predicted number of pixels, for the share of it in the image.

        The rim of the mesh comes from the initial detection and need not be the rim of the object, so a candidate that
        covers more pixels is not a better fit. The covered area does not change the cost; leaving the image increases
        it.
        """
        covered, share = self.samples.covered, self.share
        mean = np.where(covered > 0, costs / np.maximum(covered, 1), unseen)
        return self.expected * (share * mean + (1 - share) * unseen)
