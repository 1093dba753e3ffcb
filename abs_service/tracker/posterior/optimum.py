"""The optimum of one frame: the estimate of Θ, its surface, and the cost around it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import Surface
from abs_service.tracker.posterior.linearized_cost import LinearizedCost, Sensed


@dataclass(frozen=True, slots=True, eq=False)
class Optimum:
    """The parameters of minimum cost, and the cost around them.

    Attributes:
        theta: the estimate (dim,).
        surface: its surface, a population of one.
        linearized: the cost linearised near it.
        sensed: residuals of the sensors at the estimate, and their derivatives.
        inverse_curvature: Σ (dim, dim), the covariance of the estimate by Laplace's approximation.
    """

    theta: NDArray[np.float64]
    surface: Surface
    linearized: LinearizedCost
    sensed: Sensed
    inverse_curvature: NDArray[np.float64]

    @property
    def vertices(self) -> NDArray[np.float32]:
        """Vertices (n, 3) [m] of the surface."""
        return np.ascontiguousarray(self.surface.vertices[0].T)
