"""What a term is, and how its agreement with a deformed mesh is summed up."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Image
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.terms.linearization import Linear
from calib.noise.fit.truncation import deviation_within

#: Residuals up to this many deviations count as explained by the sensor's noise.
INLIER_DEVIATIONS = 3.0


@dataclass(frozen=True, slots=True)
class Bounds:
    """What one measurement costs where its noise model has nothing to say.

    Attributes:
        inlier: added to the cost of a measurement that the noise model explains.
        uniform: cost where there is no measurement, or none that this vertex could explain.
        outlier: the most that a measurement can cost.
    """

    inlier: float
    uniform: float
    outlier: float


@dataclass(frozen=True, slots=True)
class SensorFit:
    """How well one sensor agrees with one deformed mesh.

    Attributes:
        sensor: its name.
        visible: vertices that face the sensor and lie inside its image, with nothing before them that is known of.
        occluded: vertices behind the mesh's own surface, behind something else, or where the sensor has a hole.
        samples: of these, how many met a measurement.
        inliers: of these, how many the measurement's own noise explains.
        mean_log_likelihood: minus the mean cost of a vertex; a log-likelihood if that is what the objective sums.
        normalized_residual: deviation of the residuals over their own deviations, told from the inliers: 1 if the noise
            model is right, 2 if it says half of what is true; NaN where there is none, or no noise model to judge.
    """

    sensor: str
    visible: int
    occluded: int
    samples: int
    inliers: int
    mean_log_likelihood: float
    normalized_residual: float


def summarize(
    sensor: str,
    visible: NDArray[np.bool_],
    occluded: NDArray[np.bool_],
    measured: NDArray[np.bool_],
    residual: NDArray[np.float64],
    mean_log_likelihood: float,
    channels: int = 1,
) -> SensorFit:
    """Counts what the per-vertex arrays (n,) say.

    The parameters that the search fits to the residuals make them smaller by a few per cent; nothing corrects for that.

    Args:
        sensor: its name.
        visible, occluded, measured: masks of the vertices that are in sight, behind something, and have a
            measurement.
        residual: size of each residual in its deviations, the root mean square over the channels.
        mean_log_likelihood: see `SensorFit`.
        channels: values that a measurement consists of.
    """
    inlier = measured & (residual < INLIER_DEVIATIONS)
    square = float(np.mean(residual[inlier] ** 2)) if inlier.any() else float("nan")
    spread = deviation_within(square, INLIER_DEVIATIONS, channels)
    return SensorFit(
        sensor,
        visible=int(np.count_nonzero(visible)),
        occluded=int(np.count_nonzero(occluded)),
        samples=int(np.count_nonzero(measured)),
        inliers=int(np.count_nonzero(inlier)),
        mean_log_likelihood=mean_log_likelihood,
        normalized_residual=spread,
    )


def inlier_share(fits: Sequence[SensorFit]) -> float:
    """Share of the vertices visible to any sensor that agree with their measurement; 0 if none is visible."""
    visible = sum(fit.visible for fit in fits)
    return sum(fit.inliers for fit in fits) / visible if visible else 0.0


def occluded_share(fits: Sequence[SensorFit]) -> float:
    """Share of the vertices that are occluded in the sensor that sees most of them; 0 without a sensor.

    A light barrier, whose single sample is no vertex, is ignored.
    """
    shares = [fit.occluded / (fit.occluded + fit.visible) for fit in fits if fit.occluded + fit.visible > 1]
    return min(shares, default=0.0)


class Term(Protocol):
    """One sensor's part of an objective.

    Attributes:
        sensor: name of the sensor.
    """

    sensor: str

    def observe(self, image: Image, predicted: Surface, reach_m: float = np.inf) -> None:
        """Takes the image that the following costs refer to.

        Args:
            image: what the sensor measured.
            predicted: the predicted mesh, a population of one.
            reach_m: the costs of meshes that are farther from it may say no more than that they are wrong [m].
        """
        ...

    def foreground(self) -> NDArray[np.float64]:
        """Points (k, 3) [m] of things that stand between the sensor and the predicted mesh, as far as it sees them."""
        ...

    def hide(self, points: NDArray[np.float64]) -> None:
        """Leaves out of this frame what the sensor cannot see behind points (k, 3) [m] that other sensors saw."""
        ...

    def cost(self, surface: Surface) -> NDArray[np.float64]:
        """Cost (population,) of every deformed mesh."""
        ...

    def linearize(self, surface: Surface, sparse_jacobian: SparseJacobian) -> Linear:
        """The inliers' normalised residuals around a deformed mesh; arguments as in `Objective`."""
        ...

    def fit(self, surface: Surface) -> SensorFit:
        """How the sensor agrees with a population of one."""
        ...
