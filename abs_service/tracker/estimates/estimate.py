"""Estimate of the tracker for one observation."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.observation import Observation, Source
from abs_service.tracker.estimates.shape_quality import ShapeQuality
from abs_service.tracker.optimizers.base import Budget, Outcome, Stop
from abs_service.tracker.terms.agreement import inlier_share
from abs_service.tracker.terms.sensor_fit import SensorFit


class Status(StrEnum):
    """Reliability of an estimate."""

    INITIALIZING = "INITIALIZING"
    TRACKING = "TRACKING"
    DEGRADED = "DEGRADED"
    LOST = "LOST"


@dataclass(frozen=True, slots=True)
class SearchReport:
    """Result and effort of the search for theta; the defaults are those without a search.

    Attributes:
        cost: negative logarithm of likelihood times priors at theta, up to constants.
        deviation: step size of the search when it ended, in deviations of the posterior; 0 after a descent.
        searcher: algorithm that found theta: "levenberg_marquardt", "cma", "cma_es"; "" without a search.
        stop: stopping criterion that ended it.
        generations, evaluations: number of generations or steps, and of evaluations of the cost.
        limit: maximum number of evaluations.
    """

    cost: float = float("nan")
    deviation: float = float("nan")
    searcher: str = ""
    stop: Stop = Stop.NOTHING
    generations: int = 0
    evaluations: int = 0
    limit: int = 0

    @classmethod
    def of(cls, outcome: Outcome, spent: Budget) -> "SearchReport":
        """Report of a search with a budget."""
        found = outcome.cost, outcome.deviation, outcome.searcher, outcome.stop
        return cls(*found, spent.generations, spent.evaluations, spent.limit)


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """Deformation at one moment.

    Attributes:
        seq: number of the frame set.
        t_host_ns: time of the measurement, CLOCK_MONOTONIC [ns].
        sources: exposure of every sensor that contributed.
        missing: sensors that did not contribute.
        status: reliability of the estimate.
        reasons: why it is not TRACKING, in plain words.
        warnings: doubts about the object that was detected, in plain words; whatever the status.
        theta: parameters (dim,) of the model; empty while INITIALIZING.
        covariance: of theta (dim, dim), with respect to the first frame: from the curvature of the cost, the size and
            correlation of the residuals, and the covariance of the frame before.
        vertices: deformed mesh (n, 3) [m] in the rig's frame.
        vertex_covariance: of every vertex around its material point (n, 3, 3) [m²], due to the errors of theta and of
            the initial mesh, and to the misfit of the model.
        fits: agreement of every sensor.
        shape: quality of the deformed mesh.
        search: the search for theta.
    """

    seq: int
    t_host_ns: int
    sources: Mapping[str, Source]
    missing: tuple[str, ...]

    status: Status
    reasons: tuple[str, ...]
    warnings: tuple[str, ...] = ()

    theta: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    covariance: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))
    vertices: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 3), np.float32))
    vertex_covariance: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3, 3)))

    fits: tuple[SensorFit, ...] = ()
    shape: ShapeQuality = field(default_factory=ShapeQuality)
    search: SearchReport = SearchReport()

    @property
    def inlier_share(self) -> float:
        """Share of the vertices facing a depth sensor that agree with their measurement, 0…1."""
        return inlier_share(self.fits)


def initializing(observation: Observation, reasons: tuple[str, ...], warnings: tuple[str, ...]) -> Estimate:
    """The estimate as long as no object is found.

    Args:
        observation: the images of all sensors at one moment.
        reasons: why it is not found, in plain words.
        warnings: doubts about what was found.
    """
    moment = observation.seq, observation.t_host_ns, observation.sources, observation.missing
    return Estimate(*moment, Status.INITIALIZING, reasons, warnings)
