"""Covariance of the gradient of the cost, from the residuals: the middle of the sandwich estimator of Θ's covariance.

At the optimum, JᵀJ + P is the curvature of the cost, with the Jacobian J of the sensors' normalised residuals r and the
curvature P of the priors. Σ = (JᵀJ + P)⁻¹ is the covariance if the noise models are exact. They are not: a colour is
read at the nearest pixel, which adds about (slope · pixel)² / 12 (uniform quantisation) to its variance on sharp print,
and on smooth print a cautious model overestimates σ. The sandwich Σ B Σ with B = Jᵀ diag(r² / (1 − h)) J + P uses the
squared residuals instead (White, Econometrica 50, 1982). The leverage h = diag(J Σ Jᵀ) is the share of its own noise
that each residual loses to the fit (HC2 of MacKinnon and White, J. Econometrics 29, 1985): if the noise models are
exact, r² / (1 − h) is 1 on average and the sandwich equals Σ. What the priors err by beyond P is in `stretch_evidence`.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.memo import Memo
from abs_service.tracker.models.base import SparseJacobian
from abs_service.tracker.posterior.linearized_cost import Sensed
from abs_service.tracker.terms.linearization import PointLinearization, add_squares, propagated

#: Lower bound of 1 − h; below it, rounding errors dominate.
MIN_KEPT = 1e-6

#: A value of each residual (m,), by source.
PerResidual = Sequence[NDArray[np.float64]]


def leverages(inverse: NDArray[np.float64], sensed: Sensed) -> PerResidual:
    """Leverage h = diag(J Σ Jᵀ) of every residual, from Σ (dim, dim)."""
    at_points: Memo[SparseJacobian, NDArray[np.float64]] = Memo()  # sensors share the points of the mesh
    return [
        source.leverage(at_points.get(source.sparse_jacobian, partial(propagated, covariance=inverse)))
        if isinstance(source, PointLinearization)
        else source.leverage(inverse)
        for source in sensed
    ]


def variances(sensed: Sensed, leverage: PerResidual, effects: NDArray[np.float64]) -> PerResidual:
    """Variance v = D r² / (1 − h) of every residual, with what it shares with its neighbours.

    Args:
        sensed: r of the sensors.
        leverage: h.
        effects: design effect D (sources,) of the residuals of every source, see `design_effect`.
    """
    each = zip(sensed, leverage, effects)
    return [source.residual**2 * (effect / np.maximum(1 - h, MIN_KEPT)) for source, h, effect in each]


def gradient_covariance(
    priors: NDArray[np.float64], sensed: Sensed, variance: PerResidual, shares: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Covariance (dim, dim) of the gradient: B = Jᵀ diag(v) J + P, or that of shares of the errors.

    Args:
        priors: P (dim, dim), or the part.
        sensed: J of the sensors.
        variance: v.
        shares: of the errors of every source (sources,).
    """
    result = priors.copy()
    add_squares(sensed, [own * share for own, share in zip(variance, shares)], result)
    return result


def shared_covariance(sensed: Sensed, dimension: int) -> NDArray[np.float64]:
    """Covariance (dim, dim) of the gradient by errors that many residuals share, the same in all frames."""
    result = np.zeros((dimension, dimension))
    for gradients in (source.shared_gradients() for source in sensed):
        if gradients.size:
            result += gradients.T @ gradients
    return result
