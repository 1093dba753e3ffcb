"""Correlation of residuals: neighbouring points share errors that noise models do not contain.

The model cannot follow every fold, the appearance of the first frame has its own noise, an outline is off by half a
pixel along a whole edge. If the errors within a cluster of neighbouring points are correlated, their scores Jᵀr do not
cancel as those of independent errors do. Kish's design effect (Survey Sampling, 1965), here in the metric Σ of Θ,

    D = Σ_c |Σ_{i ∈ c} J_iᵀ r_i|²_Σ / Σ_i |J_iᵀ r_i|²_Σ,

is 1 for independent errors, and the number of points in a cluster if they are equal. Correlation does not end at
the border of a cluster: if it falls off exponentially with the distance, the effect of all neighbours is about
1 + 4 (D − 1), which multiplies the squared residuals of the sandwich (`sandwich`).
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.posterior.covariance.sandwich import PerResidual
from abs_service.tracker.posterior.linearized_cost import Sensed
from abs_service.tracker.terms.linearization import Part
from calib.jit import kernel

#: Side of a cluster in units of the typical distance between vertices; so a cluster has about six of them.
CLUSTER_SIDE = 2.5

#: Effect of all neighbours over that of those in a cluster: with exponential correlation and six points in a cluster,
#: between 4.0 and 4.6 for D from 1.5 to 2.
BEYOND = 4.0

#: Weight of a new frame in the running means, of which the design effect is the ratio.
MEMORY = 0.1

#: Clusters are cells of a spatial grid, numbered by a hash; cells with equal numbers are far from each other.
CLUSTERS = 1024


class DesignEffects:
    """Design effect of every source of residuals, as a running mean over the frames."""

    def __init__(self, mesh: Mesh):
        self._side_m = CLUSTER_SIDE * float(np.sqrt(mesh.area / len(mesh.vertices)))
        self._sums = np.zeros((0, 2))

    def update(self, inverse: NDArray[np.float64], sensed: Sensed, leverage: PerResidual) -> NDArray[np.float64]:
        """Design effect (sources,) of every source after another frame, at least 1.

        Args:
            inverse: Σ (dim, dim).
            sensed: residuals and derivatives of every source.
            leverage: of every residual, diag(J Σ Jᵀ).
        """
        if len(self._sums) != len(sensed):  # a sensor came or went
            self._sums = np.zeros((len(sensed), 2))
        for source, (part, share) in enumerate(zip(sensed, leverage)):
            new = self._squares(inverse, part, share)
            begun = self._sums[source, 1] > 0
            self._sums[source] += (MEMORY if begun else 1.0) * (new - self._sums[source])
        clustered, independent = self._sums.T
        within = clustered / np.where(independent > 0, independent, 1.0)
        return 1 + BEYOND * np.maximum(within - 1, 0.0)

    def _squares(self, inverse: NDArray[np.float64], part: Part, leverage: NDArray[np.float64]) -> NDArray[np.float64]:
        """Squared lengths of the scores, added up within clusters, and one by one (2,)."""
        places = part.places
        if not len(places):
            return np.zeros(2)
        clusters = np.empty(len(places), np.int64)
        shape = _find_clusters(places, 1 / self._side_m, clusters), len(inverse)
        scores = np.zeros(shape, np.float32)  # enough for a ratio, in half the time
        part.add_scores(clusters, scores)
        # Of a matrix times itself, half is computed. The squared length of a single score is r² h.
        return np.array([np.vdot(scores.T @ scores, inverse), np.vdot(part.residual**2, leverage)], np.float64)


@kernel
def _find_clusters(positions: NDArray[np.floating], per_metre: float, clusters: NDArray[np.int64]) -> int:
    """Number of clusters of positions (m, 3) [m], by the inverse side of a cell [1/m].

    Each point's cluster is written into `clusters` (m,), numbered in the order in which they are found.
    """
    numbers, count = np.full(CLUSTERS, -1, np.int64), 0  # of clusters by the hash of their cells; −1 for none yet
    for m in range(clusters.size):
        x = np.int64(np.floor(positions[m, 0] * per_metre))
        y = np.int64(np.floor(positions[m, 1] * per_metre))
        z = np.int64(np.floor(positions[m, 2] * per_metre))
        # Teschner et al., Optimized spatial hashing for collision detection of deformable objects, VMV 2003.
        cell = (x * 73856093 ^ y * 19349663 ^ z * 83492791) % numbers.size
        if numbers[cell] < 0:
            numbers[cell] = count
            count += 1
        clusters[m] = numbers[cell]
    return count
