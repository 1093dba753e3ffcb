"""How CMA-ES draws a generation, and what that teaches: rank-one and rank-μ updates (Hansen's tutorial, 2016)."""

from functools import cache
from statistics import NormalDist

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


#: Quantiles of the normal distribution that random bits are looked up among: a power of two.
_QUANTILES = 4096
#: Where the outermost quantiles end; with that, the numbers deviate by 1 to four digits.
_END = 4.0


@cache
def normal_quantiles() -> NDArray[np.float32]:
    """What `propose` turns random bits into normal numbers with."""
    inner = [NormalDist().inv_cdf(i / _QUANTILES) for i in range(1, _QUANTILES)]
    return np.array([-_END, *inner, _END], np.float32)


@kernel
def propose(
    bits: NDArray[np.uint32],
    quantiles: NDArray[np.float32],
    axes: NDArray[np.float32],
    sigma: float,
    mean: NDArray[np.float64],
    z: NDArray[np.float32],
    thetas: NDArray[np.float64],
) -> None:
    """Draws a population.

    The library's normal numbers would take as long as all the rest of a generation. Between two quantiles, whose
    probability is all that counts, the density is taken to be level; nobody needs to know a random number better.

    Args:
        bits: random (population · dim,), or more.
        quantiles: see `normal_quantiles`.
        axes, sigma, mean: as in `update`.
        z: result, standard normal numbers (population, dim).
        thetas: result (population, dim).
    """
    population, n = z.shape
    step = np.zeros(n, np.float32)
    for k in range(population):
        z_k, own = z[k], bits[k * n :]
        for i in range(np.uintp(n)):
            place, between = np.uintp(own[i] >> np.uint32(20)), np.int32(own[i] & np.uint32(0xFFFFF))
            low, high = quantiles[place], quantiles[place + np.uintp(1)]
            z_k[i] = low + np.float32(between) * np.float32(2.0**-20) * (high - low)
        step[:] = 0
        for i in range(n):
            length, axis = z_k[i], axes[i]
            for j in range(n):
                step[j] += length * axis[j]
        for j in range(n):
            thetas[k, j] = mean[j] + sigma * step[j]


@kernel
def update(
    z: NDArray[np.float32],
    axes: NDArray[np.float32],
    costs: NDArray[np.float64],
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
        costs: of the candidates (population,).
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
    order = np.argsort(costs, kind="mergesort")
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
def absorb(
    learnt: NDArray[np.float32], factor: NDArray[np.float64], path: NDArray[np.float64], axes: NDArray[np.float32]
) -> None:
    """Changes to the coordinates in which what was learnt is the identity.

    Args:
        learnt: the covariance in the old coordinates (dim, dim), of which the lower half is read; then the identity.
        factor: lower Cholesky factor (dim, dim) of the covariance of ξ when the old coordinates were made, then now.
        path: (dim,) in these coordinates.
        axes: what leads from them to Θ, a row for each (dim, dim).
    """
    n = path.size
    root, row, axis, sound = np.zeros((n, n)), np.empty(n), np.empty(n, np.float32), True
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
        axis[:] = 0
        for k in range(i, n):
            share = np.float32(root[k, i])
            for j in range(n):
                axis[j] += share * axes[k, j]
        axes[i] = axis
        for j in range(i):
            path[i] -= root[i, j] * path[j]
        path[i] /= root[i, i]
        learnt[i] = 0
        learnt[i, i] = 1
