"""Estimates of parameters that a solution does not have.

One Gauss-Newton step with their columns added to the equations; their deviations come from the scatter of the distinct
poses (a sandwich estimator, as in `calib.solve.bundle.uncertainty`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from calib.solve.bundle import robust
from calib.solve.bundle.equations import DAMPING, Equations
from calib.solve.bundle.uncertainty import MAX_SHARE, MIN_POSES


@dataclass(frozen=True)
class Estimate:
    """Further parameters that were estimated together.

    Attributes:
        sizes, sigmas: their values and standard deviations (m,).
        changes: of all other parameters if they are taken into account (n,).
    """

    sizes: NDArray[np.float64]
    sigmas: NDArray[np.float64]
    changes: NDArray[np.float64]


def further(
    equations: Equations, residuals: NDArray[np.float64], columns: Sequence[NDArray[np.float64]]
) -> Iterator[Estimate]:
    """Estimates of further parameters; none with too few distinct poses.

    Args:
        equations: at their minimum.
        residuals: normalised, there (n,).
        columns: derivatives of the k measured residuals with respect to parameters that are estimated together, (k, m)
            each.
    """
    clusters = np.unique(equations.poses, return_inverse=True)[1][equations.shots_of_rows]
    if len(set(clusters.tolist())) < MIN_POSES:
        return
    jacobian = equations.base_jacobian
    curvature = (jacobian.T @ jacobian).toarray()
    sizes = np.sqrt(np.diag(curvature))
    curvature = curvature / np.outer(sizes, sizes) + DAMPING * np.eye(len(sizes))
    pulls, efficiency = robust.influence(residuals[: len(clusters)]), robust.efficiency(residuals)
    for given in columns:
        normal = jacobian[: len(clusters)].T @ given / sizes[:, None]
        taken = linalg.solve(curvature, normal, assume_a="pos") / sizes[:, None]
        own = given - (jacobian @ taken)[: len(clusters)]
        information = _by_cluster(clusters, own[:, :, None] * own[:, None, :])
        scores = _by_cluster(clusters, own * pulls[:, None])
        variances = np.linalg.pinv(information.sum(axis=0), hermitian=True)
        found = -variances @ scores.sum(axis=0) / efficiency
        shares = np.einsum("ij,cji->c", variances, information) / given.shape[1]
        left = scores + efficiency * information @ found
        left /= np.sqrt(1 - np.minimum(shares, MAX_SHARE))[:, None]
        sigmas = np.linalg.norm(left @ variances, axis=0) / efficiency
        yield Estimate(found, sigmas, -taken @ found)


def _by_cluster(clusters: NDArray[np.intp], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums (clusters, …) of values (k, …)."""
    sums = np.zeros((int(clusters.max()) + 1, *values.shape[1:]))
    np.add.at(sums, clusters, values)
    return sums
