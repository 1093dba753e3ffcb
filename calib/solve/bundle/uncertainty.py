"""Covariance of the sensors' parameters that allows for errors which the measurements of one board pose have in common.

A lens that fits nearly, a board that is nearly flat, or blur displace the corners of a view together, so that a view
with a hundred corners says less than a hundred independent corners. How much less is seen from how far the poses pull
the solution apart: the sandwich estimator with distinct poses as clusters, each pose's pull corrected for its own
influence on the solution (CR2; R. M. Bell, D. F. McCaffrey, Survey Methodology 28, 2002).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse

from calib.solve.bundle import robust
from calib.solve.bundle.equations import Equations

#: Minimum number of distinct poses whose scatter says anything; with fewer, noise has to be taken for the only error.
MIN_POSES = 4

#: Weight of the noise's covariance, enlarged as the scatter is on average: a dozen poses do not say how forty
#: parameters vary together.
SHRINKAGE = 0.25

#: Least variance in any direction relative to the noise's: where a dozen poses agree by chance, nothing is certain.
MIN_GROWTH = 0.7

#: Share of the knowledge of a parameter that one pose may have; beyond it nothing contradicts that pose.
MAX_SHARE = 0.95


@dataclass(frozen=True)
class PoseInformation:
    """Information of each distinct pose on the sensors' k parameters, with all board poses eliminated.

    Attributes:
        information: by pose (poses, k, k).
        scores: robust gradient by pose (poses, k).
        repeats: number of shots that show each pose (poses,).
        prior: information of the priors (k, k).
        efficiency: mean derivative of the robust loss' influence.
    """

    information: NDArray[np.float64]
    scores: NDArray[np.float64]
    repeats: NDArray[np.intp]
    prior: NDArray[np.float64]
    efficiency: float


def pose_information(equations: Equations, residuals: NDArray[np.float64]) -> PoseInformation:
    """Information and scores of the poses at the minimum; `residuals` (n,) are normalised."""
    return information_of(equations.base_jacobian, equations.layout.board_start, equations, residuals)


def information_of(
    jacobian: sparse.csr_array, count: int, equations: Equations, residuals: NDArray[np.float64]
) -> PoseInformation:
    """Information and scores of the poses on the first parameters, with all board poses eliminated.

    Args:
        jacobian: of normalised residuals and priors by these parameters, then those of the board poses.
        count: number of the first parameters.
        equations: whose residuals these are.
        residuals: normalised, at the minimum (n,).
    """
    curvature = (jacobian.T @ jacobian).toarray()
    boards = -linalg.solve(curvature[count:, count:], curvature[count:, :count], assume_a="pos")
    reduced = jacobian @ np.concatenate([np.eye(count), boards])
    poses, of_shots, repeats = np.unique(equations.poses, return_inverse=True, return_counts=True)
    of_rows = of_shots[equations.shots_of_rows]
    influence = robust.influence(residuals)
    rows = [np.flatnonzero(of_rows == index) for index in range(len(poses))]
    prior = reduced[len(of_rows) :]
    return PoseInformation(
        np.stack([reduced[own].T @ reduced[own] for own in rows]),
        np.stack([reduced[own].T @ influence[own] for own in rows]),
        repeats,
        prior.T @ prior,
        robust.efficiency(residuals),
    )


def noise_covariance(poses: PoseInformation, inflation: float) -> NDArray[np.float64]:
    """Covariance (k, k) if noise were the only error and every distinct pose had been seen once."""
    once = np.sum(poses.information / poses.repeats[:, None, None], axis=0)
    return inflation * scaled_inverse(once + poses.prior)


def pose_covariance(poses: PoseInformation, noise: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance (k, k) from the scatter of the poses; `noise` as of `noise_covariance`."""
    if len(poses.scores) < MIN_POSES:
        return noise
    lower = linalg.cholesky(poses.information.sum(axis=0) + poses.prior, lower=True)
    white = linalg.solve_triangular(lower, np.eye(len(lower)), lower=True)
    scatter = white @ poses.prior @ white.T
    for information, score, repeats in zip(poses.information, poses.scores, poses.repeats, strict=True):
        shares, axes = linalg.eigh(white @ information @ white.T)
        alone = shares > MAX_SHARE
        pull = axes.T @ white @ score / (poses.efficiency * np.sqrt(1 - np.where(alone, 0, shares)))
        pull = axes @ np.where(alone, 0, pull)
        scatter += np.outer(pull, pull) + repeats * (axes * np.where(alone, shares, 0)) @ axes.T
    return _shrunk(white.T @ scatter @ white, noise)


def _shrunk(found: NDArray[np.float64], noise: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance (k, k) between the estimated one and the noise's, and nowhere much below the noise's."""
    lower = linalg.cholesky(noise, lower=True)
    white = linalg.solve_triangular(lower, np.eye(len(lower)), lower=True)
    growths, axes = linalg.eigh(white @ found @ white.T)
    growths = np.maximum((1 - SHRINKAGE) * growths + SHRINKAGE * growths.mean(), MIN_GROWTH)
    colored = lower @ axes
    return (colored * growths) @ colored.T


def with_boards(independent: NDArray[np.float64], sensors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance of all parameters (n, n): `independent`, with that of the first k replaced by `sensors` (k, k)."""
    count = len(sensors)
    own = independent[:count, :count]
    size = np.sqrt(np.diag(own))  # of pixels and of coefficients beside k6: without it, the solve loses all digits
    carried = linalg.solve(own / np.outer(size, size), independent[:count] / size[:, None], assume_a="pos").T / size
    return independent + carried @ (sensors - own) @ carried.T


def scaled_inverse(curvature: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse (k, k) of a positive definite matrix, whose parameters may differ in size by many orders."""
    size = np.sqrt(np.diag(curvature))
    inverse = linalg.inv(curvature / np.outer(size, size)) / np.outer(size, size)
    return (inverse + inverse.T) / 2
