"""Misfit of the model: where measurements disagree with the mesh by more than noise, the mesh is off by as much.

A model of few parameters cannot follow every shape. Its covariance does not know: at the optimum, what its parameters
can do balances the residuals, and outliers have no part in it. Where it misses the shape, neighbouring vertices miss it
to the same side; noise and an outlier of the sensor stand alone. So the signed distances are averaged over each vertex
and its neighbours. Pixels between object and background are off by many deviations, and far more than what surrounds
them: they are left out. What the squares of these means have beyond three of their deviations by noise, averaged once
more, is added to the covariance of the vertices in all directions. With a noisy sensor a ring of neighbours shows
little, and all of them together more: the mean square of what no single ring tells from noise is added if all of a
frame tell it. What a frame does not tell, the mean over the last frames does: else the covariance would collapse in
single ones.

Across the surface, this ends with the frame in which distances agree again. Along it, the mesh may have moved while
most of it missed, as over wrinkles that wander, and distances of which more agree again do not show it. So there the
variance is at least a running mean, over mesh and frames, until hardly any vertex misses.
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh, mean_around, ring_means
from abs_service.tracker.terms.sensor_fit import INLIER_DEVIATIONS

#: Share of the vertices that miss the measurements above which the mesh may slide, and below which it fits again.
MAJORITY, HARDLY_ANY = 0.5, 0.1

#: An outlier that its neighbours do not confirm is off by more than so many deviations. By noise alone, one of 16,000
#: distances is, which takes a thousandth from their variance; beyond three deviations lie three hundredths of it.
SINGLE_DEVIATIONS = 4.0

#: Weight of a new frame in the running means: of the misfit along the surface if that of the frame, which may be alone,
#: is larger, and of what a single frame does not tell; and if it is smaller, so that half is left after 14 frames.
RISE, FALL = 0.2, 0.05


class Misfit:
    """Variance of the vertices that the misfit of the model shows, over time."""

    def __init__(self, mesh: Mesh):
        self._common = CommonDistance(mesh)
        self._neighbours = np.diff(self._common.mean.indptr) - 1
        self._along = self._unnoticed = 0.0

    def update(
        self, distance: NDArray[np.float64], deviation: NDArray[np.float64], of_mesh: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Variances across the surface and along it, each (n,) [m²], after another frame.

        Args:
            distance: signed distances of the vertices from their measurements (n,) [m].
            deviation: of independent noise of these (n,) [m], 0 of those without noise.
            of_mesh: variance (n,) [m²] of the vertices' own errors, which are in their covariance already.
        """
        noise = np.where(deviation > 0, deviation**2 + of_mesh, 0.0)
        shared = self._without_single(distance, np.sqrt(noise))
        excess, unnoticed, is_certain = self._common.excess_and_unnoticed(shared, noise)
        self._unnoticed += RISE * (unnoticed - self._unnoticed)
        across = ring_means(self._common.mean, excess) + max(self._unnoticed, unnoticed if is_certain else 0.0)
        missing = np.count_nonzero(excess) / len(excess)
        of_most = float(across.mean()) if missing > MAJORITY else 0.0
        kept = self._along if missing > HARDLY_ANY else 0.0
        self._along = kept + (RISE if of_most > kept else FALL) * (of_most - kept)
        return across, np.maximum(across, self._along)

    def _without_single(self, distance: NDArray[np.float64], deviation: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distances (n,) [m], of which outliers that their neighbours do not confirm are replaced by these' mean."""
        mean, limit = self._common.mean, SINGLE_DEVIATIONS * deviation
        around = (ring_means(mean, distance) * (self._neighbours + 1) - distance) / np.maximum(self._neighbours, 1)
        is_single = (deviation > 0) & (np.abs(distance) > limit) & (np.abs(distance - around) > limit)
        if not is_single.any():
            return distance
        others = np.where(is_single, 0.0, distance)
        known = ring_means(mean, (~is_single).astype(np.float64))
        return np.where(is_single, ring_means(mean, others) / np.maximum(known, np.finfo(float).tiny), distance)


class CommonDistance:
    """Distances that neighbouring vertices have in common: noise and outliers stand alone.

    Attributes:
        mean: matrix (n, n) of the mean over each vertex and its neighbours.
    """

    def __init__(self, mesh: Mesh):
        self.mean = mean_around(mesh)
        self._squared = self.mean.power(2)
        self._vertices_of_ring = self.mean.nnz / self.mean.shape[0]

    def excess(self, distance: NDArray[np.float64], variance: NDArray[np.float64]) -> NDArray[np.float64]:
        """Squares of the mean distances beyond `INLIER_DEVIATIONS` of noise (n,) [m²], 0 where noise explains them.

        Args:
            distance: of the vertices (n,) [m].
            variance: of independent noise of these (n,) [m²].
        """
        squares, noise = self._squares(distance, variance)
        return _beyond(squares, noise)

    def excess_and_unnoticed(
        self, distance: NDArray[np.float64], variance: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], float, bool]:
        """`excess`, and the mean square [m²] of the means up to it, less noise; True if beyond its deviations."""
        squares, noise = self._squares(distance, variance)
        within = np.minimum(squares, INLIER_DEVIATIONS**2 * noise)
        expected = float(noise.mean())
        # Rings overlap: so many are independent as there are rings without a vertex in common.
        independent = len(distance) / self._vertices_of_ring
        common = float(within.mean()) - expected
        is_certain = common > INLIER_DEVIATIONS * expected * np.sqrt(2 / independent)
        return _beyond(squares, noise), common, bool(is_certain)

    def _squares(
        self, distance: NDArray[np.float64], variance: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Squares of the mean distances, and their means by noise alone, each (n,) [m²]."""
        return ring_means(self.mean, distance) ** 2, ring_means(self._squared, variance)


def _beyond(squares: NDArray[np.float64], noise: NDArray[np.float64]) -> NDArray[np.float64]:
    """Squares beyond `INLIER_DEVIATIONS` of noise, 0 below."""
    return np.maximum(squares - INLIER_DEVIATIONS**2 * noise, 0.0)
