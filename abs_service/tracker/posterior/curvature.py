"""The cost near one Θ as a quadratic: the coordinates in which a search is easy, the Newton step, the covariance."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from abs_service.tracker.terms.linearization import Linearization
from calib.jit import kernel

#: What is wrong with a curvature that has no Cholesky factor.
NOT_POSITIVE = "the curvature of the cost is not positive definite"


@dataclass(frozen=True, slots=True, eq=False)
class Quadratic:
    """The cost near Θ: cost(Θ + δ) ≈ cost(Θ) + gradient · δ + ½ δᵀ curvature δ.

    Attributes:
        gradient: (dim,).
        curvature: (dim, dim), symmetric; positive definite if each parameter has a prior.
    """

    gradient: NDArray[np.float64]
    curvature: NDArray[np.float64]


def gauss_newton(parts: Sequence[Linearization], dimension: int) -> Quadratic:
    """The sum of linearised parts as a quadratic: gradient Jᵀr and curvature JᵀJ of all rows."""
    gradient, curvature = np.zeros(dimension), np.zeros((dimension, dimension))
    for part in (part for part in parts if len(part.residual)):
        add_at(part.parameters, part.jacobian.T @ part.jacobian, curvature)
        gradient[part.parameters] += part.jacobian.T @ part.residual
    return Quadratic(gradient, curvature)


def add_at(parameters: NDArray[np.int64] | slice, square: NDArray[np.float64], total: NDArray[np.float64]) -> None:
    """Adds a matrix (k, k) for some parameters to one for all (dim, dim)."""
    if isinstance(parameters, slice):
        total[parameters, parameters] += square
    else:
        _scatter(parameters, square, total)


@kernel
def _scatter(parameters: NDArray[np.int64], square: NDArray[np.float64], total: NDArray[np.float64]) -> None:
    """Ten times as fast as an index of two arrays."""
    for i in range(parameters.size):
        row = total[parameters[i]]
        for j in range(parameters.size):
            row[parameters[j]] += square[i, j]


def search_metric(quadratic: Quadratic) -> NDArray[np.float64]:
    """Matrix A (dim, dim) such that Θ = start + A ξ makes the curvature of the cost the identity.

    The search is invariant under such a change of coordinates in principle; in practice it saves CMA-ES the generations
    that it would spend on learning them.
    """
    return np.asarray(np.linalg.inv(np.linalg.cholesky(quadratic.curvature)).T, np.float64)


def newton_step(quadratic: Quadratic, metric: NDArray[np.float64]) -> NDArray[np.float64]:
    """Change of Θ (dim,) that minimises the quadratic whose metric is given."""
    return -metric @ (metric.T @ quadratic.gradient)


def solved(curvature: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """The δ (dim,) with curvature δ = right, of a positive definite curvature (dim, dim), in half the usual time.

    Raises:
        LinAlgError: the curvature is not positive definite.
    """
    _, found, is_indefinite = scipy.linalg.lapack.dposv(curvature, right)
    if is_indefinite:
        raise np.linalg.LinAlgError(NOT_POSITIVE)
    return np.asarray(found, np.float64)


def posterior_covariance(quadratic: Quadratic) -> NDArray[np.float64]:
    """Covariance (dim, dim) of Θ given the measurements: the inverse of the curvature at the estimate (Laplace)."""
    factor, is_indefinite = scipy.linalg.lapack.dpotrf(quadratic.curvature, lower=True)
    if is_indefinite:
        raise np.linalg.LinAlgError(NOT_POSITIVE)
    lower = scipy.linalg.lapack.dpotri(factor, lower=True)[0]  # half the time of a general inverse
    return np.asarray(lower + np.tril(lower, -1).T, np.float64)
