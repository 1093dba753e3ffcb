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

Across the surface, this ends with the frame in which distances agree again. Along it, all of the mesh may have moved
while a part of it missed: it goes with wrinkles that wander, and stays where one of two things that touched each other
was. Distances of which more agree again do not show it. So there the variance is at least a running mean, over mesh and
frames, until hardly any vertex misses.
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh, mean_around, ring_means
from abs_service.tracker.terms.sensor_fit import INLIER_DEVIATIONS
from calib.jit import kernel

#: Share of the vertices that miss the measurements up to which the mesh cannot have moved along itself.
HARDLY_ANY = 0.1

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
        if np.count_nonzero(excess) > HARDLY_ANY * len(excess):
            of_all = float(across.mean())
            self._along += (RISE if of_all > self._along else FALL) * (of_all - self._along)
        else:
            self._along = 0.0
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
        self._vertices_of_ring = self.mean.nnz / self.mean.shape[0]

    def excess(self, distance: NDArray[np.float64], variance: NDArray[np.float64]) -> NDArray[np.float64]:
        """Squares of the mean distances beyond `INLIER_DEVIATIONS` of noise (n,) [m²], 0 where noise explains them.

        Args:
            distance: of the vertices (n,) [m].
            variance: of independent noise of these (n,) [m²].
        """
        return self.excess_and_unnoticed(distance, variance)[0]

    def excess_and_unnoticed(
        self, distance: NDArray[np.float64], variance: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], float, bool]:
        """`excess`, and the mean square [m²] of the means up to it, less noise; True if beyond its deviations."""
        n, excess = len(distance), np.empty(len(distance))
        ring = self.mean.indptr, self.mean.indices, self.mean.data
        within, noise = find_excess(*ring, distance, variance, excess)
        expected = noise / n
        # Rings overlap: so many are independent as there are rings without a vertex in common.
        independent = n / self._vertices_of_ring
        common = within / n - expected
        return excess, common, bool(common > INLIER_DEVIATIONS * expected * np.sqrt(2 / independent))


@kernel
def find_excess(
    start: NDArray[np.int32],
    around: NDArray[np.int32],
    weights: NDArray[np.float64],
    distance: NDArray[np.float64],
    variance: NDArray[np.float64],
    excess: NDArray[np.float64],
) -> tuple[float, float]:
    """Sums over all rings of the squares up to `INLIER_DEVIATIONS` of noise, and of the squares by noise alone [m²].

    Args:
        start, around, weights: of the mean over every ring, a sparse matrix (n, n).
        distance, variance: of the vertices (n,) [m] and [m²].
        excess: result, what the squares have beyond (n,) [m²].
    """
    total, expected = 0.0, 0.0
    for v in range(excess.size):
        mean, noise = 0.0, 0.0
        for k in range(start[v], start[v + 1]):
            mean += weights[k] * distance[around[k]]
            noise += weights[k] * weights[k] * variance[around[k]]
        most = INLIER_DEVIATIONS**2 * noise
        excess[v] = max(mean * mean - most, 0.0)
        total += min(mean * mean, most)
        expected += noise
    return total, expected
