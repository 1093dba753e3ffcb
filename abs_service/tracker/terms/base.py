"""Interface of a term over time and in one frame, and the bounds of its costs."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Image
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.synthesis.base import AS_MEASURED, Resampling, Synthesis
from abs_service.tracker.terms.linearization import Part, PointLinearization
from abs_service.tracker.terms.places.keypoints import Recognized
from abs_service.tracker.terms.places.patches import Patches
from abs_service.tracker.terms.sensor_fit import SensorFit
from calib.jit import kernel
from calib.no_return import CAUTIOUS, NoReturn

#: Occluders of a frame without any.
NO_OCCLUDERS: NDArray[np.float64] = np.zeros((0, 3))


@dataclass(frozen=True, slots=True)
class Bounds:
    """Costs of the outlier model of one measurement [nats].

    Attributes:
        inlier: added to the cost of an inlier.
        uniform: cost of a vertex without a measurement, or with one that it cannot explain.
        outlier: upper bound of the cost of a measurement.
        no_return: probability that a depth sensor has no return from a surface; bounds the cost of a missing one.
    """

    inlier: float
    uniform: float
    outlier: float
    no_return: NoReturn = CAUTIOUS

    @property
    def unseen(self) -> float:
        """Cost of a sample that the sensor does not see, or whose value is unknown."""
        return self.inlier + self.uniform


def facing(seen: Synthesis, surface: Surface, center: NDArray[np.float64]) -> NDArray[np.bool_]:
    """True for the samples (m,) of a population of one that are turned towards a camera with a center (3,) [m]."""
    vertices, normals = (seen.interpolation.spread(part[0].T) for part in (surface.vertices, surface.normals))
    result = np.empty(len(vertices), np.bool_)
    _mark_facing(vertices, normals, center, result)
    return result


@kernel
def _mark_facing(
    vertices: NDArray[np.floating],
    normals: NDArray[np.floating],
    center: NDArray[np.float64],
    result: NDArray[np.bool_],
) -> None:
    """Marks in `result` what `facing` returns."""
    for v in range(result.size):
        along = 0.0
        for i in range(3):
            along += normals[v, i] * (vertices[v, i] - center[i])
        result[v] = along < 0


@kernel
def line_of_sight(
    vertices: NDArray[np.float32], normals: NDArray[np.float32], v: int, center: NDArray[np.float64]
) -> tuple[float, float]:
    """Distance of vertex v (3, n) from a centre (3,) [m], and the part of the line of sight along its normal [m]."""
    square, along = 0.0, 0.0
    for i in range(3):
        sight = np.float64(vertices[i, v]) - center[i]
        square += sight * sight
        along += normals[i, v] * sight
    return np.sqrt(square), along


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """The surface that is expected in a frame, with which a sensor's image is compared.

    Attributes:
        surface: predicted mesh, a population of one.
        reach_m: radius around it outside which costs need not be exact, only high [m].
        occluders: points (k, 3) [m] that other sensors measured between themselves and the mesh.
        resampling: of the images for the views.
    """

    surface: Surface
    reach_m: float = np.inf
    occluders: NDArray[np.float64] = field(default_factory=lambda: NO_OCCLUDERS)
    resampling: Resampling = AS_MEASURED


class ObservedTerm(Protocol):
    """Negative log-likelihood of one sensor's image given a surface; asked until the sensor's next image is observed.

    The answers do not depend on the order of the calls.
    """

    @property
    def occluders(self) -> NDArray[np.float64]:
        """Measured points (k, 3) [m] between the sensor and the predicted mesh."""
        ...

    def cost(self, surface: Surface) -> NDArray[np.float64]:
        """Cost (population,) of every deformed mesh."""
        ...

    def linearize(self, surface: Surface, sparse_jacobian: SparseJacobian) -> list[Part]:
        """Normalised residuals of the inliers and their derivatives, by the origin of their errors; always as many."""
        ...

    def fit(self, surface: Surface) -> SensorFit:
        """Agreement of the sensor with a population of one."""
        ...

    def match(self, surface: Surface, sparse_jacobian: SparseJacobian, patches: Patches) -> PointLinearization:
        """Residuals of the places in the image where the appearance of a population of one is, and their derivatives.

        Args:
            surface: the deformed mesh.
            sparse_jacobian: derivative of its vertices with respect to theta.
            patches: of its vertices, which are looked for one by one.
        """
        ...

    @property
    def recognized(self) -> Recognized:
        """Keypoints of the appearance that are recognised in the image; none without an appearance."""
        ...

    def misfit(self, surface: Surface) -> NDArray[np.float64]:
        """Signed distance of each vertex from its measurement, its deviation by noise (2, n) [m]; or zeros (2, 1)."""
        ...

    def learn(self, surface: Surface) -> None:
        """Takes the estimate of the frame in, a population of one: later frames may be compared otherwise."""
        ...


class Term(Protocol):
    """The images of one sensor, one after the other.

    Attributes:
        sensor: name of the sensor.
        finds_occluders: its images show occluders, which hide the mesh from the sensors that do not.
    """

    sensor: str
    finds_occluders: bool

    def observe(self, image: Image, prediction: Prediction) -> ObservedTerm:
        """The cost of deformed meshes given an image of the sensor; it uses the memory of the image before."""
        ...
