"""What a generation of CMA-ES teaches: rank-one and rank-μ updates with negative weights (Hansen's tutorial, 2016)."""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel


class Constants:
    """Weights and learning rates for a dimension and a population, in the tutorial's words and equations."""

    def __init__(self, dimension: int, population: int):
        n = dimension
        raw = np.log((population + 1) / 2) - np.log(np.arange(1, population + 1))  # eq. 49
        up, down = raw[raw > 0], raw[raw < 0]
        mu_eff = up.sum() ** 2 / np.sum(up**2)
        mu_eff_down = down.sum() ** 2 / np.sum(down**2)
        c_c = (4 + mu_eff / n) / (n + 4 + 2 * mu_eff / n)
        c_sigma = (mu_eff + 2) / (n + mu_eff + 5)
        c_1 = 2 / ((n + 1.3) ** 2 + mu_eff)
        c_mu = min(1 - c_1, 2 * (0.25 + mu_eff + 1 / mu_eff - 2) / ((n + 2) ** 2 + mu_eff))
        d_sigma = 1 + 2 * max(0.0, np.sqrt((mu_eff - 1) / (n + 1)) - 1) + c_sigma
        down_total = min(1 + c_1 / c_mu, 1 + 2 * mu_eff_down / (mu_eff + 2), (1 - c_1 - c_mu) / (n * c_mu))  # eq. 53
        expected_length = np.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n**2))
        self.weights = np.where(raw > 0, raw / up.sum(), raw * down_total / -down.sum())
        self.rates = np.array([c_c, c_sigma, c_1, c_mu, d_sigma, mu_eff, expected_length])


@kernel
def update(
    z: NDArray[np.float32],
    axes: NDArray[np.float32],
    order: NDArray[np.int64],
    weights: NDArray[np.float64],
    rates: NDArray[np.float64],
    generation: int,
    sigma: float,
    mean: NDArray[np.float64],
    paths: NDArray[np.float64],
    learnt: NDArray[np.float32],
) -> float:
    """One generation of the tutorial's figure 6; changes mean, paths and the lower half of what is learnt.

    Args:
        z: standard normal numbers (population, dim).
        axes: what leads from them to Θ, a row for each (dim, dim).
        order: indices of the candidates, the best first.
        weights, rates: see `Constants`.
        generation: counts from one.
        sigma: step size.
        mean: (dim,).
        paths: of the step size and of the covariance, in the coordinates of z (2, dim).
        learnt: the covariance in the coordinates of z (dim, dim).

    Returns:
        The new step size.
    """
    c_c, c_sigma, c_1, c_mu, d_sigma, mu_eff, expected_length = rates
    population, n = z.shape
    p_sigma, p_c, z_mean = paths[0], paths[1], np.zeros(n)
    for rank in range(population // 2):
        w, z_k = weights[rank], z[order[rank]]
        for i in range(n):
            z_mean[i] += w * z_k[i]
    gain = np.sqrt(c_sigma * (2 - c_sigma) * mu_eff)
    square = 0.0
    for i in range(n):
        p_sigma[i] = (1 - c_sigma) * p_sigma[i] + gain * z_mean[i]
        square += p_sigma[i] * p_sigma[i]
        step, axis = sigma * z_mean[i], axes[i]
        for j in range(n):
            mean[j] += step * axis[j]
    length = np.sqrt(square) / expected_length
    usual = length / np.sqrt(1 - (1 - c_sigma) ** (2 * generation)) < 1.4 + 2 / (n + 1)
    gain = np.sqrt(c_c * (2 - c_c) * mu_eff) if usual else 0.0
    for i in range(n):
        p_c[i] = (1 - c_c) * p_c[i] + gain * z_mean[i]
    decay = np.float32(1 - c_1 - c_mu * weights.sum() + (0.0 if usual else c_1 * c_c * (2 - c_c)))
    for i in range(n):
        row, scaled = learnt[i], np.float32(c_1 * p_c[i])
        for j in range(i + 1):
            row[j] = decay * row[j] + scaled * np.float32(p_c[j])
    for rank in range(population):
        z_k, w = z[order[rank]], c_mu * weights[rank]
        if w < 0:  # eq. 46: the longer a bad step, the less is learnt from its length
            w *= n / np.dot(z_k, z_k)
        for i in range(n):
            row, scaled = learnt[i], np.float32(w) * z_k[i]
            for j in range(i + 1):
                row[j] += scaled * z_k[j]
    return sigma * np.exp(min(1.0, c_sigma / d_sigma * (length - 1)))


@kernel
def absorb(learnt: NDArray[np.float32], factor: NDArray[np.float64], path: NDArray[np.float64]) -> None:
    """Changes to the coordinates in which what was learnt is the identity.

    Args:
        learnt: the covariance in the old coordinates (dim, dim), of which the lower half is read; then the identity.
        factor: lower Cholesky factor (dim, dim) of the covariance of ξ when the old coordinates were made, then now.
        path: (dim,) in these coordinates.
    """
    n = path.size
    root, row, sound = np.zeros((n, n)), np.empty(n), True
    for i in range(n):
        for j in range(i + 1):
            left, right, rest = root[i], root[j], np.float64(learnt[i, j])
            for k in range(j):
                rest -= left[k] * right[k]
            sound = sound and (i > j or rest > 0)
            root[i, j] = rest / root[j, j] if i > j else np.sqrt(abs(rest))
    if not sound:  # rounding made it indefinite: keep the axes' deviations
        root[:] = 0
        for i in range(n):
            root[i, i] = np.sqrt(abs(learnt[i, i]))
    for i in range(n):
        row[:] = 0
        for k in range(i + 1):
            for j in range(k + 1):
                row[j] += factor[i, k] * root[k, j]
        factor[i] = row
        for j in range(i):
            path[i] -= root[i, j] * path[j]
        path[i] /= root[i, i]
        learnt[i] = 0
        learnt[i, i] = 1
