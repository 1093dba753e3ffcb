"""Misfit of the model: where measurements disagree with the mesh by more than noise, the mesh is off by as much.

A model of few parameters cannot follow every shape. Its covariance does not know: outliers have no part in it. Where it
misses the shape, neighbouring vertices miss it to the same side; an outlier of the sensor stands alone. So the signed
distances are averaged over each vertex and its neighbours, and the squares of these means, averaged once more, are
added to the covariance of the vertices in all directions.
"""

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh


class Misfit:
    """Variance of the vertices that the misfit of the model shows.

    Args:
        mesh: the mesh.
    """

    def __init__(self, mesh: Mesh):
        n, edges = len(mesh.vertices), mesh.edges
        rows, columns = np.concatenate([edges, edges[:, ::-1], np.tile(np.arange(n)[:, None], 2)]).T
        ring = scipy.sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=(n, n))
        self._mean = scipy.sparse.csr_array(scipy.sparse.diags_array(1 / ring.sum(axis=1)) @ ring)

    def variance(self, excess: NDArray[np.float64]) -> NDArray[np.float64]:
        """Variance (n,) [m²] from signed distances (n,) [m] beyond what noise explains."""
        return self._mean @ (self._mean @ excess) ** 2 if excess.any() else excess
