"""Covariance of Θ with respect to the first frame: residuals, their correlation, and the frames before."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.posterior.covariance.design_effect import DesignEffects
from abs_service.tracker.posterior.covariance.error_propagation import (
    LASTING,
    ErrorPropagation,
    FrameErrors,
    LastingShares,
    Motion,
)
from abs_service.tracker.posterior.covariance.observability import held_back, unobserved_motion
from abs_service.tracker.posterior.covariance.registration_error import registration_covariance
from abs_service.tracker.posterior.covariance.sandwich import (
    gradient_covariance,
    leverages,
    shared_covariance,
    variances,
)
from abs_service.tracker.posterior.frame_posterior import FramePosterior
from abs_service.tracker.posterior.optimum import Optimum
from abs_service.tracker.posterior.priors.motion_prior import RecentMotion
from abs_service.tracker.posterior.stretch_evidence import StretchEvidence


class ThetaCovariance:
    """Covariance of the estimates of Θ of one object over time.

    Args:
        model: the deformation model.
        registration_m: standard deviation of the pose of a template's mesh; 0 if the first frame defines it [m].
    """

    def __init__(self, model: DeformationModel, registration_m: float):
        self._effects, self._lasting, self._stretch = DesignEffects(model.mesh), LastingShares(), StretchEvidence()
        self._errors = ErrorPropagation(registration_covariance(model, registration_m))

    def restart(self, covariance: NDArray[np.float64]) -> None:
        """Restarts with errors of a covariance (dim, dim), after a relocation."""
        self._errors.restart(covariance)

    def update(self, optimum: Optimum, frame: FramePosterior, recent: RecentMotion) -> NDArray[np.float64]:
        """Covariance (dim, dim) of the estimate of a frame."""
        prediction = frame.motion
        inverse, sensed, precision = optimum.inverse_curvature, optimum.sensed, prediction.precision
        leverage = leverages(inverse, sensed)
        priors = optimum.linearized.priors - precision + self._stretch.excess(optimum, frame)
        variance = variances(sensed, leverage, self._effects.update(inverse, sensed, leverage))
        lasting = self._lasting.update(sensed)
        errors = FrameErrors(
            inverse=inverse,
            precision=precision,
            own=gradient_covariance((1 - LASTING) * priors, sensed, variance, 1 - lasting),
            lasting=gradient_covariance(LASTING * priors, sensed, variance, lasting)
            + shared_covariance(sensed, len(optimum.theta)),
        )
        unobserved = unobserved_motion(recent.unmeasured, optimum, prediction)
        covariance = self._errors.update(Motion(recent.unpredicted, unobserved, prediction.persistence), errors)
        held = held_back(optimum, prediction)
        return covariance + np.outer(held, held)
