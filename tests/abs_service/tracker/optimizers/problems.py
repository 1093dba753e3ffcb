"""Costs whose minima are known, for optimisers."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import SparseJacobian
from abs_service.tracker.optimizers.base import Budget, Outcome, RunningSearch, Search
from abs_service.tracker.posterior.curvature import Quadratic
from abs_service.tracker.posterior.linearized_cost import LinearizedCost
from abs_service.tracker.terms.sensor_fit import SensorFit
from abs_service.tracker.terms.vertex_counts import VertexCounts

#: Step of the central differences.
STEP = 1e-5

#: Number of measurements, of which a share are outliers.
MEASUREMENTS = 10**6


@dataclass
class Known:
    """A cost over Θ as a sum of squares, and a prior around 0.

    Attributes:
        dimension: number of parameters.
        residuals: (population, m) of parameters (population, dim); the cost is half their squares' sum.
        outlier_share_at: share of outliers at parameters (dim,).
        deviation: of the prior, which `residuals` contains already.
        shown: where images show the surface (dim,), if anywhere.
    """

    dimension: int
    residuals: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    outlier_share_at: Callable[[NDArray[np.float64]], float]
    deviation: float = 1.0
    shown: NDArray[np.float64] | None = None

    def cost(self, thetas: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Problem`."""
        return 0.5 * np.sum(self.residuals(thetas) ** 2, axis=1)

    def linearize(self, theta: NDArray[np.float64]) -> LinearizedCost:
        """See `Problem`."""
        offsets = STEP * np.eye(self.dimension)
        jacobian = (self.residuals(theta + offsets) - self.residuals(theta - offsets)).T / (2 * STEP)
        quadratic = Quadratic(jacobian.T @ self.residuals(theta[None])[0], jacobian.T @ jacobian)
        no_vertices = SparseJacobian.from_dense(np.zeros((0, 3, self.dimension)))
        return LinearizedCost(theta, quadratic, self.prior(theta).curvature, [], no_vertices)

    def prior(self, theta: NDArray[np.float64]) -> Quadratic:
        """See `Problem`."""
        return Quadratic(theta / self.deviation**2, np.eye(self.dimension) / self.deviation**2)

    def shown_at(self, theta: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """See `Problem`."""
        return self.shown

    def fits(self, theta: NDArray[np.float64]) -> tuple[SensorFit, ...]:
        """See `Problem`."""
        inliers = round(MEASUREMENTS * (1 - self.outlier_share_at(theta)))
        counts = VertexCounts(facing=MEASUREMENTS, agreeing=inliers, disagreeing=MEASUREMENTS - inliers)
        return (SensorFit("", MEASUREMENTS, 0, MEASUREMENTS, inliers, 0.0, 1.0, counts=counts),)


def minimize(problem: Known, search: Search, budget: Budget) -> Outcome:
    """The outcome of a search, driven as the tracker does."""
    running = RunningSearch(search)
    while running.outcome is None:
        thetas = running.ask()
        budget.evaluations += len(thetas)
        running.tell(problem.cost(thetas))
    return running.outcome


def linear(target: NDArray[np.float64], scale: NDArray[np.float64]) -> Known:
    """Residuals (Θ − target) · scale, explained everywhere."""
    return Known(len(target), lambda thetas: (thetas - target) * scale, lambda theta: 0.0)


def rosenbrock(dimension: int) -> Known:
    """Rosenbrock's banana: a bent valley with its end at (1, …, 1)."""

    def residuals(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.sqrt(2) * np.concatenate([10 * (x[:, 1:] - x[:, :-1] ** 2), 1 - x[:, :-1]], axis=1)

    return Known(dimension, residuals, lambda theta: 0.0)


def two_wells(far: NDArray[np.float64], depth: float = 400.0) -> Known:
    """A shallow well at 0 and one at `far` (dim,) that is deeper by `depth` nats; half of all are outliers at 0."""

    def residuals(x: NDArray[np.float64]) -> NDArray[np.float64]:
        near = np.column_stack([10 * x, np.full(len(x), np.sqrt(2 * depth))])
        deep = np.column_stack([10 * (x - far), np.zeros(len(x))])
        return np.where(np.sum(near**2, axis=1)[:, None] < np.sum(deep**2, axis=1)[:, None], near, deep)

    def outlier_share(theta: NDArray[np.float64]) -> float:
        return 0.02 if np.linalg.norm(theta - far) < np.linalg.norm(theta) else 0.5

    return Known(len(far), residuals, outlier_share)
