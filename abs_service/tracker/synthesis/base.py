"""Interfaces of synthesis: samples of deformed meshes in a sensor's image, and images in the same geometry."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Window
from abs_service.pairing.observation import Observation
from abs_service.tracker.memo import Memo
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import SparseJacobian, Surface
from calib.camera import Camera


class Interpolation(Protocol):
    """Values at the samples of a population from those at the n vertices of its meshes."""

    def spread(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Interpolates values (n, …) of the vertices at the samples (m, …) of a population of one."""
        ...

    def follow(self, sparse_jacobian: SparseJacobian) -> SparseJacobian:
        """Jacobian of the samples of a population of one with respect to theta, from that of its vertices."""
        ...

    def carry(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Interpolates values (population, n) of the vertices at the samples (population, m)."""
        ...

    def balance(self, costs: NDArray[np.float64], unseen: float) -> NDArray[np.float64]:
        """Costs (population,), normalised so that candidates with different numbers of samples are comparable.

        Args:
            costs: sums over the samples (population,).
            unseen: cost of a sample that the sensor does not see.
        """
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Synthesis:
    """Synthetic measurements of a population in one sensor: m samples per candidate.

    Attributes:
        pixel: index (population, m) into the sensor's flattened texture with a border of one pixel; 0, in the border,
            where the sensor cannot see the sample (outside the image, behind the camera, or facing away); −1 where
            there is no sample, which contributes zero cost.
        distance: radial distance from the camera centre (population, m) [m], eq. 11, to the intersection of the line of
            sight through the pixel's centre (which was measured) with the tangent plane; in the border, to the sample.
        attributes: attributes of the surface there, such as colour, (population or 1, channels, m).
        interpolation: from the vertices to the samples.
    """

    pixel: NDArray[np.int32]
    distance: NDArray[np.float32]
    attributes: NDArray[np.float32]
    interpolation: Interpolation


def once(single: Memo[Surface, Synthesis], surface: Surface, synthesize: Callable[[Surface], Synthesis]) -> Synthesis:
    """The synthesis of a population; that of a surface by itself is kept, since costs, fits and derivatives ask for it.

    Args:
        single: syntheses of populations of one in one frame.
        surface: the population.
        synthesize: makes one that is not known.
    """
    return synthesize(surface) if len(surface.vertices) > 1 else single.get(surface, synthesize)


class ObservedView(Protocol):
    """Projection of a mesh into one camera in one frame; what it answers does not depend on the order of the calls."""

    @property
    def camera(self) -> Camera:
        """The camera into whose image the mesh is synthesised."""
        ...

    def synthesize(self, surface: Surface) -> Synthesis:
        """Synthesises a population of deformed meshes."""
        ...

    def attribute_gradients(self, seen: Synthesis) -> NDArray[np.float32]:
        """Gradients of the attributes at the samples of a population of one (m, channels, 2) [1/px], right and down.

        NaN where only the samples' own attributes are known.
        """
        ...


class View(Protocol):
    """Projection of a mesh into one camera.

    Attributes:
        camera: the camera into whose image the mesh is synthesised.
    """

    camera: Camera

    def observe(self, predicted: Surface) -> ObservedView:
        """The view in one frame; the predicted mesh, a population of one, tells which parts are occluded in it.

        The occlusion is the same for every candidate, so it favours none.
        """
        ...

    def render(self, surface: Surface) -> NDArray[np.float32]:
        """Radial distances (height, width) [m] of a population of one in the camera's image; infinite off the mesh.

        The image is valid until the next one is rendered.
        """
        ...

    def observe_rendered(self, predicted: Surface) -> tuple[ObservedView, NDArray[np.float32]]:
        """`observe` and `render` of the predicted mesh, which is rasterised once."""
        ...


class Resampling(Protocol):
    """The images of one frame in the geometry of the views."""

    def texture(self, sensor: str, texture: NDArray[np.float32]) -> NDArray[np.float32]:
        """The noise texture (height + 2, width + 2, 8) of a depth sensor's frame, in its view's camera."""
        ...

    def image(self, sensor: str, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """An image (height, width, channels) of a sensor, in its view's camera; NaN where unknown."""
        ...


class AsMeasured:
    """The views have the geometry of the sensors' own images, which are not resampled."""

    def texture(self, sensor: str, texture: NDArray[np.float32]) -> NDArray[np.float32]:
        """The texture itself."""
        return texture

    def image(self, sensor: str, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """The image itself."""
        return image


AS_MEASURED = AsMeasured()


class Synthesizer(Protocol):
    """Views of all sensors of a rig, and their images in the geometry of these views.

    Attributes:
        canvas: the mesh on whose vertices the appearance is sampled for the views: the deformed mesh or a finer one.
        resamples: true if views have another geometry than the sensors' own images.
    """

    canvas: Mesh
    resamples: bool

    def observe(self, observation: Observation) -> Resampling:
        """The resampling of an observation's images into the geometry of the views."""
        ...

    def view(self, sensor: str, attributes: NDArray[np.float32]) -> View:
        """View of the mesh with attributes of the canvas (vertices, channels) in one sensor's camera."""
        ...

    def window(self, sensor: str, predicted: Surface, reach_m: float) -> Window:
        """Window of a sensor's image, and of its view's camera, that can contain the surface.

        Args:
            sensor: its name.
            predicted: predicted surface, a population of one.
            reach_m: largest distance of the surface from the prediction [m].
        """
        ...
