"""CMA-ES, compiled: full covariance, rank-one and rank-μ updates, negative weights (Hansen's tutorial, 2016)."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from abs_service.tracker.optimizers.evolution import Evolution, Schedule, usual_population
from calib.jit import kernel


@dataclass(frozen=True)
class Settings:
    """TOML keys of the search.

    Attributes:
        population: candidates per generation; 0 lets CMA-ES choose 4 + 3 ln dim.
        generations: generations per frame at most.
        step: standard deviation of the first candidates, in posterior deviations of the parameters.
        least_step: the step size never starts a frame below this, so that the search can follow motion.
        tolerance: the search has converged when costs differ by less than this [nats], within a generation and between
            the best ones of five.
        restarts: how often the population may double in the first frame, where the object is searched for widely.
    """

    population: Annotated[int, Ge(0)] = 0
    generations: Annotated[int, Ge(1)] = 20
    step: Annotated[float, Gt(0)] = 1.0
    least_step: Annotated[float, Gt(0)] = 0.5
    tolerance: Annotated[float, Gt(0)] = 0.5
    restarts: Annotated[int, Ge(0)] = 3

    def build(self, dimension: int, generator: np.random.Generator) -> Evolution:
        """A search in `dimension` dimensions that draws from `generator`."""
        make = partial(CmaEs, dimension, generator, self.least_step)
        population = self.population or usual_population(dimension)
        schedule = Schedule("cma_es", self.generations, self.tolerance)
        return Evolution(schedule, make, population, self.step, self.restarts)


#: Share of the covariance that may be new before candidates are drawn with it.
LEARNT = 0.1

#: Share of the covariance that begins every frame anew, as the identity.
FORGOTTEN = 0.5


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


class CmaEs:
    """Mean, step size and covariance of one frame start the next; see `Strategy` for the interface.

    Candidates are drawn with the Cholesky factor of the covariance in place of its symmetric root, which distributes
    them equally and costs a fraction of an eigendecomposition. The factor is a new one when a share `LEARNT` of the
    covariance may be new; with few parameters that is every generation. The evolution path of the step size lives in
    the coordinates of that factor (Krause, Arbonès, Igel: CMA-ES with optimal covariance update and storage complexity,
    2016).

    Args:
        dimension: of ξ.
        generator: source of all randomness.
        least_step: the step size never starts a frame below this.
        population: candidates per generation.
        step: standard deviation of the first candidates.
    """

    def __init__(self, dimension: int, generator: np.random.Generator, least_step: float, population: int, step: float):
        self._generator = generator
        self._steps = least_step, step
        self._constants = Constants(dimension, population)
        self._mean = np.zeros(dimension)
        self._sigma = step
        self._paths = np.zeros((2, dimension))
        self._covariance = np.eye(dimension)
        self._factor = np.eye(dimension)
        self._generation = 0
        self._gap = max(1, int(LEARNT / (self._constants.rates[2] + self._constants.rates[3])))
        self._z = np.zeros((population, dimension))
        self._y = np.zeros((population, dimension))

    @property
    def deviation(self) -> float:
        """Current step size σ."""
        return self._sigma

    @property
    def mean(self) -> NDArray[np.float64]:
        """Centre (dim,) of the current distribution."""
        return self._mean.copy()

    def restart(self) -> None:
        """Moves the mean to the prediction, ξ = 0; half of the covariance, and the step size, continue.

        In ξ every frame's cost is nearly round by itself. What long searches learn beyond that is how rough the cost of
        one frame is: where they have narrowed the covariance frame after frame, they cannot follow motion any more.
        """
        self._mean[:] = 0
        self._sigma = float(np.clip(self._sigma, *self._steps))
        self._covariance *= 1 - FORGOTTEN
        self._covariance.flat[:: len(self._mean) + 1] += FORGOTTEN
        _factorize(self._covariance, self._factor)

    def ask(self) -> NDArray[np.float64]:
        """The next candidates (population, dim)."""
        # Single precision takes half the time, and nobody needs to know a random number better.
        self._z = self._generator.standard_normal(self._z.shape, np.float32).astype(np.float64)
        np.matmul(self._z, self._factor.T, out=self._y)
        candidates = self._sigma * self._y
        candidates += self._mean
        return candidates

    def tell(self, candidates: NDArray[np.float64], costs: NDArray[np.float64]) -> None:
        """Updates mean, step size and covariance; the candidates are those of the last `ask`."""
        self._generation += 1
        self._sigma = _update(
            self._z,
            self._y,
            np.argsort(costs, kind="stable"),
            self._constants.weights,
            self._constants.rates,
            self._generation,
            self._sigma,
            self._mean,
            self._paths,
            self._covariance,
        )
        if self._generation % self._gap == 0 and not _factorize(
            self._covariance, self._factor
        ):  # rounding made it indefinite: keep the axes' deviations
            self._covariance = np.diag(np.diag(self._covariance))
            self._factor = np.sqrt(self._covariance)


@kernel
def _update(
    z: NDArray[np.float64],
    y: NDArray[np.float64],
    order: NDArray[np.int64],
    weights: NDArray[np.float64],
    rates: NDArray[np.float64],
    generation: int,
    sigma: float,
    mean: NDArray[np.float64],
    paths: NDArray[np.float64],
    covariance: NDArray[np.float64],
) -> float:
    """One generation of the tutorial's figure 6; changes mean, paths and the lower half of the covariance.

    Args:
        z, y: standard normal numbers (population, dim) and their product with the covariance's factor.
        order: indices of the candidates, the best first.
        weights, rates: see `Constants`.
        generation: counts from one.
        sigma: step size.
        mean: (dim,).
        paths: of the step size, in the coordinates of z, and of the covariance (2, dim).
        covariance: (dim, dim).

    Returns:
        The new step size.
    """
    c_c, c_sigma, c_1, c_mu, d_sigma, mu_eff, expected_length = rates
    population, n = z.shape
    p_sigma, p_c = paths[0], paths[1]
    z_mean, y_mean = np.zeros(n), np.zeros(n)
    for rank in range(population // 2):
        w, z_k, y_k = weights[rank], z[order[rank]], y[order[rank]]
        for i in range(n):
            z_mean[i] += w * z_k[i]
            y_mean[i] += w * y_k[i]
    gain = np.sqrt(c_sigma * (2 - c_sigma) * mu_eff)
    square = 0.0
    for i in range(n):
        mean[i] += sigma * y_mean[i]
        p_sigma[i] = (1 - c_sigma) * p_sigma[i] + gain * z_mean[i]
        square += p_sigma[i] * p_sigma[i]
    length = np.sqrt(square) / expected_length
    usual = length / np.sqrt(1 - (1 - c_sigma) ** (2 * generation)) < 1.4 + 2 / (n + 1)
    gain = np.sqrt(c_c * (2 - c_c) * mu_eff) if usual else 0.0
    for i in range(n):
        p_c[i] = (1 - c_c) * p_c[i] + gain * y_mean[i]
    decay = 1 - c_1 - c_mu * weights.sum() + (0.0 if usual else c_1 * c_c * (2 - c_c))
    for i in range(n):
        row, scaled = covariance[i], c_1 * p_c[i]
        for j in range(i + 1):
            row[j] = decay * row[j] + scaled * p_c[j]
    for rank in range(population):
        z_k, y_k, w = z[order[rank]], y[order[rank]], c_mu * weights[rank]
        if w < 0:  # eq. 46: the longer a bad step, the less is learnt from its length
            w *= n / np.dot(z_k, z_k)
        for i in range(n):
            row, scaled = covariance[i], w * y_k[i]
            for j in range(i + 1):
                row[j] += scaled * y_k[j]
    return sigma * np.exp(min(1.0, c_sigma / d_sigma * (length - 1)))


@kernel
def _factorize(matrix: NDArray[np.float64], factor: NDArray[np.float64]) -> bool:
    """Cholesky factor (dim, dim) of a matrix of which the lower half is read; false if it is not positive definite."""
    for i in range(matrix.shape[0]):
        for j in range(i + 1):
            left, right = factor[i], factor[j]
            rest = matrix[i, j]
            for k in range(j):
                rest -= left[k] * right[k]
            if i > j:
                factor[i, j] = rest / factor[j, j]
            elif rest > 0:
                factor[i, i] = np.sqrt(rest)
            else:
                return False
    return True
