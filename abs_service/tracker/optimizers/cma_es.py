"""CMA-ES, compiled: full covariance and evolution paths, continued from frame to frame."""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.optimizers.base import Costs
from abs_service.tracker.optimizers.search.ask_and_tell import AskAndTell, AskAndTellSettings
from abs_service.tracker.optimizers.search.cma_update import (
    Constants,
    normal_quantiles,
    sample_population,
    update_distribution,
    update_factor,
)


@dataclass(frozen=True)
class Settings(AskAndTellSettings):
    """TOML keys of the search."""

    def build(self, dimension: int, generator: np.random.Generator) -> AskAndTell:
        """A search in `dimension` dimensions that draws from `generator`."""
        make = partial(CmaEsSampler, dimension, generator, self.minimum_step)
        return AskAndTell("cma_es", self, dimension, make)


#: The Cholesky factor is updated when this share of the covariance may have changed.
LEARNT = 0.1

#: Share of the covariance that every frame resets to the identity.
FORGOTTEN = 0.5


class CmaEsSampler:
    """A `Sampler`: CMA-ES. Step size and covariance of one frame start the next.

    Candidates are drawn with the Cholesky factor of the covariance instead of its symmetric root: the distribution is
    the same, without an eigendecomposition. Evolution paths and covariance update are kept in the coordinates of that
    factor, in which the covariance was the identity when the factor was made (Krause, Arbonès, Igel: CMA-ES with
    optimal covariance update and storage complexity, 2016), so one product maps normal numbers to Θ. The factor is
    updated when a share `LEARNT` of the covariance may have changed; with few parameters in every generation.

    Args:
        dimension: of Θ.
        generator: source of all randomness; its bits come 64 at a time, as those of NumPy's default do.
        minimum_step: minimum step size at the start of a frame.
        population: candidates per generation.
        step: initial standard deviation of the candidates.
    """

    def __init__(
        self, dimension: int, generator: np.random.Generator, minimum_step: float, population: int, step: float
    ):
        self._bits = generator.bit_generator
        self._steps = minimum_step, step
        self._constants = Constants(dimension, population)
        self._sigma = step
        self._generation = 0
        self._gap = max(1, int(LEARNT / (self._constants.rates[2] + self._constants.rates[3])))
        self._z = np.zeros((population, dimension), np.float32)
        self._mean = np.zeros(dimension)
        # Single precision takes half the time and is precise enough for a step.
        self._axes, self._learnt = np.eye(dimension, dtype=np.float32), np.eye(dimension, dtype=np.float32)
        self._factor, self._paths = np.eye(dimension), np.zeros((2, dimension))

    @property
    def deviation(self) -> float:
        """Current step size σ."""
        return self._sigma

    @property
    def mean(self) -> NDArray[np.float64]:
        """Mean (dim,) of the current distribution."""
        return self._mean.copy()

    def restart(self, origin: NDArray[np.float64], metric: NDArray[np.float64]) -> None:
        """Moves the mean to the prediction; half of the covariance, and the step size, continue.

        In ξ the cost of every frame is nearly round. Beyond that, long searches learn the roughness of one frame's
        cost; with a covariance that they narrowed frame after frame, they can no longer follow motion.
        """
        self._mean[:] = origin
        self._sigma = float(np.clip(self._sigma, *self._steps))
        update_factor(self._learnt, self._factor, self._paths[1], self._axes)
        covariance = (1 - FORGOTTEN) * self._factor @ self._factor.T
        covariance.flat[:: len(covariance) + 1] += FORGOTTEN
        factor = np.asarray(np.linalg.cholesky(covariance), np.float64)
        self._paths[1] = np.linalg.solve(factor, self._factor @ self._paths[1])
        self._factor[:] = factor
        self._axes[:] = np.matmul(factor.T, metric.T)

    def ask(self) -> NDArray[np.float64]:
        """The next candidates (population, dim)."""
        thetas, size = np.empty(self._z.shape), self._z.size
        bits = self._bits.random_raw((size + 3) // 4).view(np.uint16)[:size]
        sample_population(bits, normal_quantiles(), self._axes, self._sigma, self._mean, self._z, thetas)
        return thetas

    def tell(self, costs: Costs) -> None:
        """Updates the distribution with the costs (population,) of the last candidates."""
        self._generation += 1
        self._sigma = update_distribution(
            self._z,
            self._axes,
            costs.argsort(kind="stable"),
            self._constants.weights,
            self._constants.rates,
            self._generation,
            self._sigma,
            self._mean,
            self._paths,
            self._learnt,
        )
        if self._generation % self._gap == 0:
            update_factor(self._learnt, self._factor, self._paths[1], self._axes)
