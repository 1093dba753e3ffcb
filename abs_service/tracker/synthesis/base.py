"""What a synthesis is: samples of deformed meshes as a sensor would see them, and images that fit them."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.observation import Observation
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.synthesis.window import Window
from calib.camera import Camera


@dataclass(frozen=True, slots=True, eq=False)
class Synthesis:
    """What a sensor would see of a population: m samples of every member.

    Attributes:
        pixel: index (population, m) into the sensor's flattened texture with a border of one pixel; 0, in the border,
            where the sensor cannot see the sample (outside the image, behind the camera, or facing away); −1 where
            there is no sample, which costs nothing.
        distance: radial distance from the camera centre (population, m) [m], eq. 11: of where the line of sight of the
            pixel's centre, which is what was measured, meets the tangential plane; of the sample itself in the border.
        attributes: what the surface carries there, such as its colour, (population or 1, m, channels).
    """

    pixel: NDArray[np.int32]
    distance: NDArray[np.float32]
    attributes: NDArray[np.float32]


class View(Protocol):
    """A mesh through one camera.

    Attributes:
        camera: the camera into whose image it is synthesised.
    """

    camera: Camera

    def look(self, predicted: Surface) -> None:
        """Decides from the predicted mesh, a population of one, what is hidden from the sensor in this frame.

        That is the same for every candidate, so hiding is neither rewarded nor punished.
        """
        ...

    def synthesize(self, surface: Surface) -> Synthesis:
        """Synthesises a population of deformed meshes."""
        ...

    def slopes(self, surface: Surface) -> NDArray[np.float32]:
        """How the attributes of a population of one change around its samples in the image (m, channels, 2).

        To the right and down, per pixel; NaN where only the samples' own attributes are known.
        """
        ...

    def spread(self, surface: Surface, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values (n, …) of the vertices at the samples (m, …) of a population of one."""
        ...

    def follow(self, surface: Surface, sparse_jacobian: SparseJacobian) -> SparseJacobian:
        """How the samples of a population of one move, from how its vertices do."""
        ...

    def carry(self, surface: Surface, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Values (population, n) of the vertices at the samples (population, m)."""
        ...

    def balance(self, costs: NDArray[np.float64], surface: Surface, unseen: float) -> NDArray[np.float64]:
        """Costs (population,), made comparable between members that have more samples and such that have fewer.

        Args:
            costs: sums over the samples (population,).
            surface: the population.
            unseen: what a sample costs that the sensor does not see.
        """
        ...

    def render(self, surface: Surface) -> NDArray[np.float32]:
        """Radial distances (height, width) [m] of a population of one in the camera's image, infinite beside it."""
        ...


class Synthesizer(Protocol):
    """Views of all sensors of a rig, and their images as these views need them.

    Attributes:
        canvas: the mesh on whose vertices the views want to be given the appearance: the deformed mesh itself, or a
            finer one.
    """

    canvas: Mesh

    def observe(self, observation: Observation) -> None:
        """Takes the images that the following calls refer to."""
        ...

    def view(self, sensor: str, attributes: NDArray[np.float32]) -> View:
        """The mesh with attributes of the canvas (vertices, channels) through one sensor's camera."""
        ...

    def window(self, sensor: str, predicted: Surface, reach_m: float) -> Window:
        """The part of a sensor's image that a surface can be in, the same in that of its view's camera.

        Args:
            sensor: its name.
            predicted: where the surface is expected, a population of one.
            reach_m: how far it may be from there [m].
        """
        ...

    def texture(self, sensor: str, texture: NDArray[np.float32]) -> NDArray[np.float32]:
        """A rendered noise model (height + 2, width + 2, 8) of a depth sensor's frame in its view's camera."""
        ...

    def image(self, sensor: str, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """An image (height, width, channels) of a sensor in its view's camera; NaN where nothing is known."""
        ...
