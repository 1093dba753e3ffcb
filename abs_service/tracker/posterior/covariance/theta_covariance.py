"""Covariance of Θ with respect to the first frame: residuals, their correlation, and the frames before."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.posterior.covariance.design_effect import DesignEffects
from abs_service.tracker.posterior.covariance.error_propagation import ErrorPropagation, FrameErrors, Motion
from abs_service.tracker.posterior.covariance.observability import held_back, unobserved_motion
from abs_service.tracker.posterior.covariance.registration_error import registration_covariance
from abs_service.tracker.posterior.covariance.sandwich import gradient_covariance, leverages, shared_covariance
from abs_service.tracker.posterior.optimum import Optimum
from abs_service.tracker.posterior.priors.motion_prediction import MotionPrediction
from abs_service.tracker.posterior.priors.motion_prior import RecentMotion


class ThetaCovariance:
    """Covariance of the estimates of Θ of one object over time.

    Args:
        model: the deformation model.
        registration_m: standard deviation of the pose of a template's mesh; 0 if the first frame defines it [m].
    """

    def __init__(self, model: DeformationModel, registration_m: float):
        self._effects = DesignEffects(model.mesh)
        self._errors = ErrorPropagation(registration_covariance(model, registration_m))

    def restart(self, covariance: NDArray[np.float64]) -> None:
        """Restarts with errors of a covariance (dim, dim), after a relocation."""
        self._errors.restart(covariance)

    def update(self, optimum: Optimum, prediction: MotionPrediction, recent: RecentMotion) -> NDArray[np.float64]:
        """Covariance (dim, dim) of the estimate of a frame."""
        inverse, linearized, sensed = optimum.inverse_curvature, optimum.linearized, optimum.sensed
        leverage = leverages(inverse, sensed)
        effects = self._effects.update(inverse, sensed, leverage)
        errors = FrameErrors(
            inverse=inverse,
            precision=prediction.precision,
            gradient=gradient_covariance(linearized.priors, sensed, leverage, effects),
            shared=shared_covariance(sensed, len(optimum.theta)),
        )
        unobserved = unobserved_motion(recent.unmeasured, optimum, prediction)
        covariance = self._errors.update(Motion(recent.unpredicted, unobserved, prediction.persistence), errors)
        held = held_back(optimum, prediction)
        return covariance + np.outer(held, held)
