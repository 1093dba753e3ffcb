"""CMA-ES, compiled: full covariance, evolution paths, what one frame teaches the next."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from abs_service.tracker.optimizers.evolution import Evolution, Schedule, usual_population
from abs_service.tracker.optimizers.generation import Constants, absorb, normal_quantiles, padded, propose, update


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


class CmaEs:
    """Step size and covariance of one frame start the next; see `Strategy` for the interface.

    Candidates are drawn with the Cholesky factor of the covariance in place of its symmetric root, which distributes
    them equally and costs a fraction of an eigendecomposition. Both evolution paths, and what is learnt of the
    covariance, live in the coordinates of that factor, in which the covariance was the identity when the factor was
    made (Krause, Arbonès, Igel: CMA-ES with optimal covariance update and storage complexity, 2016): one product leads
    from normal numbers to Θ. The factor is a new one when a share `LEARNT` of the covariance may be new; with few
    parameters that is every generation.

    Args:
        dimension: of Θ.
        generator: source of all randomness; its bits come 64 at a time, as those of NumPy's default do.
        least_step: the step size never starts a frame below this.
        population: candidates per generation.
        step: standard deviation of the first candidates.
    """

    def __init__(self, dimension: int, generator: np.random.Generator, least_step: float, population: int, step: float):
        self._bits = generator.bit_generator
        self._steps = least_step, step
        self._constants = Constants(dimension, population)
        self._mean = np.zeros(dimension)
        self._sigma = step
        self._paths = np.zeros((2, dimension))
        self._generation = 0
        self._gap = max(1, int(LEARNT / (self._constants.rates[2] + self._constants.rates[3])))
        # Single precision takes half the time, and nobody needs to know a step better.
        self._shape = population, dimension
        self._z = padded(np.zeros(self._shape))
        self._factor = np.eye(dimension)
        self._learnt, self._axes = padded(self._factor), padded(self._factor)

    @property
    def deviation(self) -> float:
        """Current step size σ."""
        return self._sigma

    @property
    def mean(self) -> NDArray[np.float64]:
        """Centre (dim,) of the current distribution."""
        return self._mean.copy()

    def restart(self, origin: NDArray[np.float64], metric: NDArray[np.float64]) -> None:
        """Moves the mean to the prediction; half of the covariance, and the step size, continue.

        In ξ every frame's cost is nearly round by itself. What long searches learn beyond that is how rough the cost of
        one frame is: where they have narrowed the covariance frame after frame, they cannot follow motion any more.
        """
        self._mean = origin.copy()
        self._sigma = float(np.clip(self._sigma, *self._steps))
        absorb(self._learnt, self._factor, self._paths[1], self._axes)
        covariance = (1 - FORGOTTEN) * self._factor @ self._factor.T
        covariance.flat[:: len(covariance) + 1] += FORGOTTEN
        factor = np.asarray(np.linalg.cholesky(covariance), np.float64)
        self._paths[1] = np.linalg.solve(factor, self._factor @ self._paths[1])
        self._factor = factor
        self._axes = padded(np.matmul(factor.T, metric.T))

    def ask(self) -> NDArray[np.float64]:
        """The next candidates (population, dim)."""
        thetas = np.empty(self._shape)
        bits = self._bits.random_raw((thetas.size + 3) // 4).view(np.uint16)
        propose(bits, normal_quantiles(), self._axes, self._sigma, self._mean, self._z, thetas)
        return thetas

    def tell(self, costs: NDArray[np.float64]) -> None:
        """Updates mean, step size and covariance."""
        self._generation += 1
        self._sigma = update(
            self._z,
            self._axes,
            costs,
            self._constants.weights,
            self._constants.rates,
            self._generation,
            self._sigma,
            self._mean,
            self._paths,
            self._learnt,
        )
        if self._generation % self._gap == 0:
            absorb(self._learnt, self._factor, self._paths[1], self._axes)
