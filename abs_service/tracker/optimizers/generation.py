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


#: What is multiplied has multiples of so many columns and rows, what it does not need being zeros: loops over them then
#: leave nothing over that would have to be computed one by one.
LANES, ROWS = 8, 4


def padded(matrix: NDArray[np.floating]) -> NDArray[np.float32]:
    """A matrix in single precision, with zeros as `LANES` and `ROWS` ask for."""
    rows, columns = matrix.shape
    return np.pad(matrix, ((0, -rows % ROWS), (0, -columns % LANES))).astype(np.float32)


@kernel
def propose(
    bits: NDArray[np.uint16],
    quantiles: NDArray[np.float32],
    axes: NDArray[np.float32],
    sigma: float,
    mean: NDArray[np.float64],
    z: NDArray[np.float32],
    thetas: NDArray[np.float64],
) -> None:
    """Draws a population.

    The library's normal numbers would take as long as all the rest of a generation. Between two quantiles, whose
    probability is all that counts, there are 16 numbers that are equally likely; nobody needs to know one better.

    Args:
        bits: random (population · dim,), or more.
        quantiles: see `normal_quantiles`.
        axes, sigma, mean: as in `update`.
        z: result, standard normal numbers (population, dim), `padded`.
        thetas: result (population, dim).
    """
    population, n = thetas.shape
    step, lanes = np.zeros(z.shape[1], np.float32), np.uintp(z.shape[1] // LANES * LANES)
    for k in range(population):
        z_k, own = z[k], bits[k * n :]
        for i in range(np.uintp(n)):
            place, between = np.uintp(own[i] >> np.uint16(4)), np.int32(own[i] & np.uint16(15))
            low, high = quantiles[place], quantiles[place + np.uintp(1)]
            z_k[i] = low + (np.float32(between) + np.float32(0.5)) * np.float32(0.0625) * (high - low)
        step[:] = 0
        for i in range(0, n, ROWS):  # four at a time: what is added up is read and written less often
            a, b, c, d = z_k[i], z_k[i + 1], z_k[i + 2], z_k[i + 3]
            of_a, of_b, of_c, of_d = axes[i], axes[i + 1], axes[i + 2], axes[i + 3]
            for j in range(lanes):
                step[j] += (a * of_a[j] + b * of_b[j]) + (c * of_c[j] + d * of_d[j])
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
        z: standard normal numbers (population, dim), `padded`.
        axes: what leads from them to Θ, a row for each (dim, dim), `padded`.
        costs: of the candidates (population,).
        weights, rates: see `Constants`.
        generation: counts from one.
        sigma: step size.
        mean: (dim,).
        paths: of the step size and of the covariance, in the coordinates of z (2, dim).
        learnt: the covariance in the coordinates of z (dim, dim), `padded`.

    Returns:
        The new step size.
    """
    c_c, c_sigma, c_1, c_mu, d_sigma, mu_eff, expected_length = rates
    population, n = costs.size, mean.size
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
    decay = 1 - c_1 - c_mu * weights.sum() + (0.0 if usual else c_1 * c_c * (2 - c_c))
    _learn(z, order, weights, p_c, decay, c_1, c_mu, learnt)
    return sigma * np.exp(min(1.0, c_sigma / d_sigma * (length - 1)))


@kernel
def _learn(
    z: NDArray[np.float32],
    order: NDArray[np.intp],
    weights: NDArray[np.float64],
    path: NDArray[np.float64],
    decay: float,
    c_1: float,
    c_mu: float,
    learnt: NDArray[np.float32],
) -> None:
    """Eq. 47 in the coordinates of z: the lower half, and in each row what is left up to a multiple of `LANES`."""
    n, population = path.size, order.size
    p, scales, rows = np.zeros(z.shape[1], np.float32), np.zeros(len(z), np.float32), np.arange(len(z))
    p[:n] = path
    for rank in range(population):
        rows[rank], w = order[rank], c_mu * weights[rank]
        if w < 0:  # eq. 46: the longer a bad step, the less is learnt from its length
            w *= n / np.dot(z[order[rank]], z[order[rank]])
        scales[rank] = w
    for i in range(n):
        row, scaled, lanes = learnt[i], np.float32(c_1) * p[i], np.uintp((i // LANES + 1) * LANES)
        for j in range(lanes):
            row[j] = np.float32(decay) * row[j] + scaled * p[j]
    for rank in range(0, len(z), ROWS):
        z_a, z_b, z_c, z_d = z[rows[rank]], z[rows[rank + 1]], z[rows[rank + 2]], z[rows[rank + 3]]
        for i in range(n):
            a, b = scales[rank] * z_a[i], scales[rank + 1] * z_b[i]
            c, d = scales[rank + 2] * z_c[i], scales[rank + 3] * z_d[i]
            row, lanes = learnt[i], np.uintp((i // LANES + 1) * LANES)
            for j in range(lanes):
                row[j] += (a * z_a[j] + b * z_b[j]) + (c * z_c[j] + d * z_d[j])


@kernel
def absorb(
    learnt: NDArray[np.float32], factor: NDArray[np.float64], path: NDArray[np.float64], axes: NDArray[np.float32]
) -> None:
    """Changes to the coordinates in which what was learnt is the identity.

    Args:
        learnt: the covariance in the old coordinates (dim, dim), `padded`, its lower half; then the identity.
        factor: lower Cholesky factor (dim, dim) of the covariance of ξ when the old coordinates were made, then now.
        path: (dim,) in these coordinates.
        axes: what leads from them to Θ, a row for each (dim, dim), `padded`.
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
        axes[i, :n] = axis
        for j in range(i):
            path[i] -= root[i, j] * path[j]
        path[i] /= root[i, i]
        learnt[i] = 0
        learnt[i, i] = 1
