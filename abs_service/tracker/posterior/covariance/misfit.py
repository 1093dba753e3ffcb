"""Misfit of the model: where measurements disagree with the mesh by more than noise, the mesh is off by as much.

A model of few parameters cannot follow every shape. Its covariance does not know: at the optimum, what its parameters
can do balances the residuals, and outliers have no part in it. Where it misses the shape, neighbouring vertices miss it
to the same side; noise and an outlier of the sensor stand alone. So the signed distances are averaged over each vertex
and its neighbours. What the squares of these means have beyond three of their deviations by noise, averaged once more,
is added to the covariance of the vertices in all directions.

Across the surface, this ends with the frame in which distances agree again. Along it, the mesh may have moved
meanwhile, as over wrinkles that wander, and distances that agree again do not show it. So a misfit of most of the mesh
fades there, as its mean, because the mesh slides as a whole.
"""

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.terms.base import INLIER_DEVIATIONS

#: Share of the variance along the surface that is left in the next frame: half of it after 14 frames.
LASTING = 0.95


class Misfit:
    """Variance of the vertices that the misfit of the model shows, over time.

    Args:
        mesh: the mesh.
    """

    def __init__(self, mesh: Mesh):
        n, edges = len(mesh.vertices), mesh.edges
        rows, columns = np.concatenate([edges, edges[:, ::-1], np.tile(np.arange(n)[:, None], 2)]).T
        ring = scipy.sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=(n, n))
        self._mean = scipy.sparse.csr_array(scipy.sparse.diags_array(1 / ring.sum(axis=1)) @ ring)
        self._squared = self._mean.power(2)
        self._along = 0.0

    def update(
        self, distance: NDArray[np.float64], deviation: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Variances across the surface and along it, each (n,) [m²], after another frame.

        Args:
            distance: signed distances of the vertices from their measurements (n,) [m].
            deviation: of independent noise of these (n,) [m].
        """
        noise = self._squared @ deviation**2
        excess = np.maximum((self._mean @ distance) ** 2 - INLIER_DEVIATIONS**2 * noise, 0.0)
        across = self._mean @ excess
        of_most = float(across.mean()) if np.median(excess) > 0 else 0.0
        self._along = max(of_most, LASTING * self._along)
        return across, np.maximum(across, self._along)
