"""Surfaces of one frame and their derivatives: start, cost, covariance and agreement of one Θ ask one after another."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.memo import Memo
from abs_service.tracker.models.base import DeformationModel, SparseJacobian, Surface


class FrameSurfaces:
    """The meshes that one frame deforms; each Θ by itself has one surface and one Jacobian, in whatever order.

    Sensors know a surface that they have seen in this frame again. Nobody asks for a population twice.

    Attributes:
        model: the deformation model, which does not change within the frame.
    """

    def __init__(self, model: DeformationModel):
        self.model = model
        self._single: Memo[bytes, Surface] = Memo()
        self._jacobians: Memo[bytes, SparseJacobian] = Memo()

    def deform(self, thetas: NDArray[np.float64]) -> Surface:
        """The mesh deformed with every row of `thetas` (population, dim)."""
        if len(thetas) > 1:
            return self.model.deform(thetas)
        return self._single.get(thetas.tobytes(), lambda key: self.model.deform(thetas))

    def with_jacobian(self, theta: NDArray[np.float64]) -> tuple[Surface, SparseJacobian]:
        """The mesh deformed with theta (dim,), a population of one, and the derivatives of its vertices."""
        return self.deform(theta[None]), self.sparse_jacobian(theta)

    def sparse_jacobian(self, theta: NDArray[np.float64]) -> SparseJacobian:
        """Derivatives of the vertices with respect to theta (dim,)."""
        return self._jacobians.get(theta.tobytes(), lambda key: self.model.sparse_jacobian(theta))
