"""Curvature of the cost around a prediction: the coordinates in which the search is easy."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.terms.base import Linearization

#: Surface motion [m] of the central differences that give the vertices' derivatives.
STEP_M = 1e-3


def vertex_jacobian(model: DeformationModel, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivatives (n, 3, dim) of the vertices by the parameters, by central differences."""
    steps = STEP_M * model.scales
    offsets = np.diag(steps)
    vertices = model.deform(np.concatenate([theta + offsets, theta - offsets])).vertices.astype(np.float64)
    plus, minus = vertices[: len(steps)], vertices[len(steps) :]
    return ((plus - minus) / (2 * steps)[:, None, None]).transpose(2, 1, 0)


def search_metric(jacobian: NDArray[np.float64]) -> NDArray[np.float64]:
    """Matrix A (dim, dim) such that Θ = prediction + A ξ makes the curvature of the cost the identity.

    With J the derivatives (m, dim) of all normalised residuals, JᵀJ is the Gauss–Newton curvature of the negative
    log-likelihood and its inverse A Aᵀ the posterior covariance. The search is invariant under such a change of
    coordinates in principle; in practice it saves CMA-ES the generations that it would spend on learning them.
    """
    lower = np.linalg.cholesky(jacobian.T @ jacobian)
    return np.asarray(np.linalg.inv(lower).T, np.float64)


def newton_step(linear: Linearization, metric: NDArray[np.float64]) -> NDArray[np.float64]:
    """Change of Θ (dim,) that minimises the linearised cost, for the metric of the same linearisation."""
    return -metric @ (metric.T @ (linear.jacobian.T @ linear.residual))
