"""Quadratic approximation of the cost near one Θ: preconditioner of the search, Newton step, covariance."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from abs_service.tracker.terms.grouped import GroupedLinearization
from abs_service.tracker.terms.linearization import Part, PointLinearization, add_gradients, add_squares

#: Message of the error for a curvature without a Cholesky factor.
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

    def __add__(self, other: "Quadratic") -> "Quadratic":
        return Quadratic(self.gradient + other.gradient, self.curvature + other.curvature)


def gauss_newton(parts: Sequence[Part | GroupedLinearization], dimension: int) -> Quadratic:
    """Gauss–Newton approximation of the cost: sums of the gradients Jᵀr and the curvatures JᵀJ of all parts."""
    gradient, curvature, at_points = np.zeros(dimension), np.zeros((dimension, dimension)), []
    for part in (part for part in parts if len(part.residual)):
        if isinstance(part, PointLinearization):
            at_points.append(part)
        else:
            part.add_gradient(gradient)
            part.add_curvature(curvature)
    add_gradients(at_points, gradient)
    add_squares(at_points, [np.ones(len(part.residual)) for part in at_points], curvature)
    return Quadratic(gradient, curvature)


def search_metric(quadratic: Quadratic) -> NDArray[np.float64]:
    """Preconditioner A (dim, dim): with Θ = start + A ξ, the curvature of the cost in ξ is the identity.

    CMA-ES is invariant under this change of coordinates, but saves the generations for adapting its covariance.
    """
    return np.asarray(np.linalg.inv(np.linalg.cholesky(quadratic.curvature)).T, np.float64)


def newton_step(quadratic: Quadratic, metric: NDArray[np.float64]) -> NDArray[np.float64]:
    """Newton step of Θ (dim,), from the gradient of the quadratic and its preconditioner."""
    return -metric @ (metric.T @ quadratic.gradient)


def solved(curvature: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solution δ (dim,) of curvature δ = right by Cholesky, for a positive definite curvature (dim, dim).

    Raises:
        LinAlgError: the curvature is not positive definite.
    """
    _, found, is_indefinite = scipy.linalg.lapack.dposv(curvature.T, right)  # symmetric: the copy keeps its order
    if is_indefinite:
        raise np.linalg.LinAlgError(NOT_POSITIVE)
    return np.asarray(found, np.float64)


def whitened(curvature: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """L⁻¹ right (dim, k) with curvature = L Lᵀ: the sums of its squares are rightᵀ curvature⁻¹ right, column by column.

    Raises:
        LinAlgError: the curvature is not positive definite.
    """
    return np.asarray(scipy.linalg.blas.dtrsm(1.0, _cholesky(curvature), right, lower=True), np.float64)


def posterior_covariance(quadratic: Quadratic) -> NDArray[np.float64]:
    """Covariance (dim, dim) of Θ given the measurements: the inverse of the curvature at the estimate (Laplace).

    Raises:
        LinAlgError: the curvature is not positive definite.
    """
    inverse = scipy.linalg.lapack.dtrtri(_cholesky(quadratic.curvature), lower=True)[0]  # of the factor
    return np.asarray(inverse.T @ inverse, np.float64)


def _cholesky(curvature: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lower Cholesky factor (dim, dim), see `whitened`."""
    factor, is_indefinite = scipy.linalg.lapack.dpotrf(curvature.T, lower=True)  # symmetric: the copy keeps its order
    if is_indefinite:
        raise np.linalg.LinAlgError(NOT_POSITIVE)
    return factor
