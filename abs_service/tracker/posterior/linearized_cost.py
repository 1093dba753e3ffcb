"""The cost of one frame near one Θ, with the residuals and derivatives from which its covariance is made."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import SparseJacobian
from abs_service.tracker.posterior.curvature import Quadratic
from abs_service.tracker.terms.linearization import Part

#: Residuals and derivatives of the sensors, by the source of their errors.
Sensed = Sequence[Part]

#: A linearisation holds within this many nats per parameter: the length of the last step of a descent, and half the
#: step that the noise of a frame causes.
NEAR = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class LinearizedCost:
    """The cost near one theta.

    Attributes:
        theta: the parameters (dim,).
        quadratic: Gauss–Newton approximation of likelihood and priors.
        priors: curvature (dim, dim) of the priors alone.
        sensed: residuals and derivatives of the sensors.
        sparse_jacobian: derivatives of the vertices.
    """

    theta: NDArray[np.float64]
    quadratic: Quadratic
    priors: NDArray[np.float64]
    sensed: Sensed
    sparse_jacobian: SparseJacobian

    def holds_at(self, theta: NDArray[np.float64]) -> bool:
        """True if theta (dim,) is so near that the linearisation holds there as well."""
        step = theta - self.theta
        return bool(0.5 * step @ self.quadratic.curvature @ step < NEAR * len(theta))

    def sensed_at(self, theta: NDArray[np.float64]) -> Sensed:
        """Residuals and derivatives of the sensors, the residuals extrapolated to theta (dim,)."""
        step = theta - self.theta
        return [source.moved(step) for source in self.sensed]
