"""Estimate of the tracker for one observation."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.observation import Observation, Source
from abs_service.tracker.optimizers.base import Stop
from abs_service.tracker.shape_quality import ShapeQuality
from abs_service.tracker.terms.sensor_fit import SensorFit


class Status(StrEnum):
    """Reliability of an estimate."""

    INITIALIZING = "INITIALIZING"
    TRACKING = "TRACKING"
    DEGRADED = "DEGRADED"
    LOST = "LOST"


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """Deformation at one moment.

    Attributes:
        seq: number of the frame set.
        t_host_ns: time of the measurement, CLOCK_MONOTONIC [ns].
        status: reliability of the estimate.
        reasons: why it is not TRACKING, in plain words.
        theta: parameters (dim,) of the model; empty while INITIALIZING.
        covariance: of theta (dim, dim), with respect to the first frame: from the curvature of the cost, the size and
            correlation of the residuals, and the covariance of the frame before.
        vertices: deformed mesh (n, 3) [m] in the rig's frame.
        vertex_covariance: of every vertex around its material point (n, 3, 3) [m²], due to the errors of theta and of
            the initial mesh, and to the misfit of the model.
        cost: negative logarithm of likelihood times priors at theta, up to constants.
        deviation: step size of the search when it ended, in deviations of the posterior; 0 after a descent.
        searcher: algorithm that found theta: "levenberg_marquardt", "cma", "cma_es"; "" while INITIALIZING.
        stop: stopping criterion that ended the search.
        generations, evaluations: number of generations or steps, and of evaluations of the cost.
        budget: maximum number of evaluations.
        inlier_share: share of the vertices facing a depth sensor that agree with their measurement, 0…1.
        fits: agreement of every sensor.
        shape: quality of the deformed mesh.
        sources: exposure of every sensor that contributed.
        missing: sensors that did not contribute.
        warnings: doubts about the object that was detected, in plain words; whatever the status.
    """

    seq: int
    t_host_ns: int
    status: Status
    reasons: tuple[str, ...]
    theta: NDArray[np.float64]
    covariance: NDArray[np.float64]
    vertices: NDArray[np.float32]
    vertex_covariance: NDArray[np.float64]
    cost: float
    deviation: float
    searcher: str
    stop: Stop
    generations: int
    evaluations: int
    budget: int
    inlier_share: float
    fits: tuple[SensorFit, ...]
    shape: ShapeQuality
    sources: Mapping[str, Source]
    missing: tuple[str, ...]
    warnings: tuple[str, ...] = ()


def initializing(observation: Observation, reasons: tuple[str, ...], warnings: tuple[str, ...]) -> Estimate:
    """The estimate as long as no object is found.

    Args:
        observation: the images of all sensors at one moment.
        reasons: why it is not found, in plain words.
        warnings: doubts about what was found.
    """
    return Estimate(
        seq=observation.seq,
        t_host_ns=observation.t_host_ns,
        status=Status.INITIALIZING,
        reasons=reasons,
        theta=np.zeros(0),
        covariance=np.zeros((0, 0)),
        vertices=np.zeros((0, 3), np.float32),
        vertex_covariance=np.zeros((0, 3, 3)),
        cost=float("nan"),
        deviation=float("nan"),
        searcher="",
        stop=Stop.NOTHING,
        generations=0,
        evaluations=0,
        budget=0,
        inlier_share=0.0,
        fits=(),
        shape=ShapeQuality(),
        sources=observation.sources,
        missing=observation.missing,
        warnings=warnings,
    )
