"""Kernels of CMA-ES: sampling, rank-one and rank-μ updates (Hansen: The CMA evolution strategy, a tutorial, 2016)."""

from functools import cache
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel


class Constants:
    """Weights and learning rates for a dimension and a population, with the equation numbers of the tutorial."""

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


#: Number of tabulated quantiles of the normal distribution: a power of two.
_QUANTILES = 4096
#: Outermost quantiles; with these the standard deviation of the numbers is 1 to four digits.
_END = 4.0


@cache
def normal_quantiles() -> NDArray[np.float32]:
    """Table from random bits to normal numbers, see `sample_population`."""
    inner = [NormalDist().inv_cdf(i / _QUANTILES) for i in range(1, _QUANTILES)]
    return np.array([-_END, *inner, _END], np.float32)


@kernel
def sample_population(
    bits: NDArray[np.uint16],
    quantiles: NDArray[np.float32],
    axes: NDArray[np.float32],
    sigma: float,
    mean: NDArray[np.float64],
    z: NDArray[np.float32],
    thetas: NDArray[np.float64],
) -> None:
    """Draws a population by a table of normal quantiles.

    NumPy's normal numbers would take as long as the rest of a generation. Between two quantiles there are 16 equally
    likely numbers, which is fine enough for a search.

    Args:
        bits: random (population · dim,), or more.
        quantiles: see `normal_quantiles`.
        axes, sigma, mean: as in `update`.
        z: result, standard normal numbers (population, dim).
        thetas: result (population, dim).
    """
    numbers = z.reshape(-1)
    for i in range(np.uintp(z.size)):
        place, between = np.uintp(bits[i] >> np.uint16(4)), np.int32(bits[i] & np.uint16(15))
        low, high = quantiles[place], quantiles[place + np.uintp(1)]
        numbers[i] = low + (np.float32(between) + np.float32(0.5)) * np.float32(0.0625) * (high - low)
    steps = np.empty((len(z), mean.size), np.float32)
    np.dot(z, axes, steps)
    for k in range(len(z)):
        for j in range(mean.size):
            thetas[k, j] = mean[j] + sigma * steps[k, j]


@kernel
def update_distribution(
    z: NDArray[np.float32],
    axes: NDArray[np.float32],
    order: NDArray[np.intp],
    weights: NDArray[np.float64],
    rates: NDArray[np.float64],
    generation: int,
    sigma: float,
    mean: NDArray[np.float64],
    paths: NDArray[np.float64],
    learnt: NDArray[np.float32],
) -> float:
    """One generation of the tutorial's figure 6; updates mean, paths and covariance in place, returns the step size.

    Args:
        z: standard normal numbers (population, dim).
        axes: maps them to Θ, one row for each (dim, dim).
        order: of the candidates by their costs (population,).
        weights, rates: see `Constants`.
        generation: counts from one.
        sigma: step size.
        mean: (dim,).
        paths: of the step size and of the covariance, in the coordinates of z (2, dim).
        learnt: covariance in the coordinates of z (dim, dim).
    """
    c_c, c_sigma, c_1, c_mu, d_sigma, mu_eff, expected_length = rates
    population, n = order.size, mean.size
    ranked = np.empty((population + 1, n), np.float32)  # and in the end the path
    for rank in range(population):
        for i in range(n):
            ranked[rank, i] = z[order[rank], i]
    p_sigma, p_c, z_mean = paths[0], paths[1], np.zeros(n)
    for rank in range(population // 2):
        w, step = weights[rank], ranked[rank]
        for i in range(n):
            z_mean[i] += w * step[i]
    gain = np.sqrt(c_sigma * (2 - c_sigma) * mu_eff)
    square = 0.0
    for i in range(n):
        p_sigma[i] = (1 - c_sigma) * p_sigma[i] + gain * z_mean[i]
        square += p_sigma[i] * p_sigma[i]
        by, axis = sigma * z_mean[i], axes[i]
        for j in range(n):
            mean[j] += by * axis[j]
    length = np.sqrt(square) / expected_length
    h_sigma = length / np.sqrt(1 - (1 - c_sigma) ** (2 * generation)) < 1.4 + 2 / (n + 1)
    gain = np.sqrt(c_c * (2 - c_c) * mu_eff) if h_sigma else 0.0
    for i in range(n):
        p_c[i] = (1 - c_c) * p_c[i] + gain * z_mean[i]
        ranked[population, i] = p_c[i]
    decay = 1 - c_1 - c_mu * weights.sum() + (0.0 if h_sigma else c_1 * c_c * (2 - c_c))
    _learn(ranked, weights, decay, c_1, c_mu, learnt)
    return sigma * np.exp(min(1.0, c_sigma / d_sigma * (length - 1)))


@kernel
def _learn(
    steps: NDArray[np.float32],
    weights: NDArray[np.float64],
    decay: float,
    c_1: float,
    c_mu: float,
    learnt: NDArray[np.float32],
) -> None:
    """Eq. 47 in the coordinates of z, from its rows, ranked by cost, and the path (population + 1, dim)."""
    n = steps.shape[1]
    weighted, learning = np.empty((len(steps), n), np.float32), np.empty((n, n), np.float32)
    for rank in range(len(steps)):
        step, w = steps[rank], c_mu * weights[rank] if rank < weights.size else c_1
        if w < 0:  # eq. 46: negative weights are scaled by the squared length of the step
            square = np.float32(0)
            for i in range(n):
                square += step[i] * step[i]
            w *= n / square
        for i in range(n):
            weighted[rank, i] = np.float32(w) * step[i]
    np.dot(weighted.T, steps, learning)
    for i in range(n):
        for j in range(n):
            learnt[i, j] = np.float32(decay) * learnt[i, j] + learning[i, j]


@kernel
def update_factor(
    learnt: NDArray[np.float32], factor: NDArray[np.float64], path: NDArray[np.float64], axes: NDArray[np.float32]
) -> None:
    """Changes to the coordinates in which the learnt covariance is the identity.

    Args:
        learnt: covariance in the old coordinates (dim, dim); the identity on return.
        factor: lower Cholesky factor (dim, dim) of the covariance of ξ when the old coordinates were made; updated.
        path: (dim,) in these coordinates.
        axes: maps them to Θ, one row for each (dim, dim).
    """
    n = path.size
    root, sound = np.zeros((n, n)), True
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
    new_factor, new_axes = np.empty((n, n)), np.empty((n, n), np.float32)
    np.dot(factor, root, new_factor)
    np.dot(root.astype(np.float32).T, axes, new_axes)
    for i in range(n):
        for j in range(n):
            factor[i, j], axes[i, j] = new_factor[i, j], new_axes[i, j]
        for j in range(i):
            path[i] -= root[i, j] * path[j]
        path[i] /= root[i, i]
        learnt[i] = 0
        learnt[i, i] = 1
