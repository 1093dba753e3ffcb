"""Misfit of the model: where measurements disagree with the mesh by more than noise, the mesh is off by as much.

A model of few parameters cannot follow every shape. Its covariance does not know: outliers have no part in it. Their
squared distances, averaged over neighbouring vertices, are added to the covariance of the vertices in all directions.
"""

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh


class NeighborMean:
    """Mean over the vertices that are at most two edges away.

    Args:
        mesh: the mesh.
    """

    def __init__(self, mesh: Mesh):
        n, edges = len(mesh.vertices), mesh.edges
        rows, columns = np.concatenate([edges, edges[:, ::-1], np.tile(np.arange(n)[:, None], 2)]).T
        ring = scipy.sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=(n, n))
        self._weights = scipy.sparse.csr_array(ring @ ring)
        self._weights.data[:] = 1.0
        self._count = np.asarray(self._weights.sum(axis=1), np.float64)

    def __call__(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Means (n,) of values (n,)."""
        return (self._weights @ values) / self._count if values.any() else values
