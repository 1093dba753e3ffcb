"""The answer of the tracker to one observation."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.observation import Source
from abs_service.tracker.optimizers.base import Stop
from abs_service.tracker.terms.base import SensorFit


class Status(StrEnum):
    """How far an estimate can be trusted."""

    INITIALIZING = "INITIALIZING"
    TRACKING = "TRACKING"
    DEGRADED = "DEGRADED"
    LOST = "LOST"


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """Deformation at one moment.

    Attributes:
        seq: number of the frame set.
        t_host_ns: the moment it shows, CLOCK_MONOTONIC [ns].
        status: how far to trust it.
        reasons: why it is not TRACKING, in plain words.
        theta: parameters (dim,) of the model; empty while INITIALIZING.
        covariance: of theta (dim, dim), the inverse curvature of the cost at theta; an approximation that trusts the
            noise models and knows nothing of other minima.
        vertices: deformed mesh (n, 3) [m] in the rig's frame.
        vertex_covariance: of every vertex around its material point (n, 3, 3) [m²]: what is unknown of theta, and what
            was unknown of the mesh when it was made.
        cost: negative logarithm of likelihood times priors at theta, up to constants.
        deviation: step size of the search when it ended, in deviations of the posterior; 0 after a descent.
        searcher: what found theta: "levenberg_marquardt", "cma", "cma_es"; "" while INITIALIZING.
        stop: why the search ended.
        generations, evaluations: what the frame took: generations or steps, and how often the cost was computed.
        budget: how often the cost was allowed to be computed.
        inlier_share: share of the vertices facing a depth sensor that agree with their measurement, 0…1.
        fits: how every sensor agrees.
        sources: exposure of every sensor that contributed.
        missing: sensors that did not contribute.
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
    sources: Mapping[str, Source]
    missing: tuple[str, ...]
