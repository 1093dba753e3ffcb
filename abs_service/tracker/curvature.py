"""Curvature of the cost around a prediction: the coordinates in which the search is easy."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import DeformationModel

#: Surface motion [m] of the central differences that give the vertices' derivatives.
STEP_M = 1e-3


def vertex_jacobian(model: DeformationModel, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivatives (n, 3, dim) of the vertices by the parameters, by central differences."""
    steps = STEP_M * model.scales
    offsets = np.diag(steps)
    vertices = model.deform(np.concatenate([theta + offsets, theta - offsets])).vertices.astype(np.float64)
    plus, minus = vertices[: len(steps)], vertices[len(steps) :]
    return ((plus - minus) / (2 * steps)[:, None, None]).transpose(2, 1, 0)


def search_metric(residual_jacobian: NDArray[np.float64]) -> NDArray[np.float64]:
    """Matrix A (dim, dim) such that Θ = prediction + A ξ makes the curvature of the cost the identity.

    With J the derivatives (m, dim) of all normalised residuals, JᵀJ is the Gauss–Newton curvature of the negative
    log-likelihood and its inverse A Aᵀ the posterior covariance. The search is invariant under such a change of
    coordinates in principle; in practice it saves CMA-ES the generations that it would spend on learning them.
    """
    hessian = residual_jacobian.T @ residual_jacobian
    values, vectors = np.linalg.eigh(hessian)
    return vectors / np.sqrt(np.maximum(values, values[-1] * 1e-12))
