"""CMA-ES by its authors' library, pycma: the reference search; too slow to be live in more than a few dimensions."""

import warnings
from dataclasses import dataclass
from functools import partial
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from abs_service.tracker.optimizers.base import Budget, Problem
from abs_service.tracker.optimizers.course import Course
from abs_service.tracker.optimizers.evolution import Evolution, Schedule, advance_by_one, usual_population


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
        make = partial(Cma, dimension, generator, self.least_step)
        population = self.population or usual_population(dimension)
        return Evolution(Schedule("cma", self.generations, self.tolerance), make, population, self.step, self.restarts)


class Cma:
    """Step size and covariance of one frame start the next; see `Strategy` for the interface.

    Args:
        dimension: of Θ.
        generator: source of all randomness.
        least_step: the step size never starts a frame below this.
        population: candidates per generation.
        step: standard deviation of the first candidates.
    """

    def __init__(self, dimension: int, generator: np.random.Generator, least_step: float, population: int, step: float):
        with warnings.catch_warnings():  # pycma regrets that it cannot plot
            warnings.simplefilter("ignore")
            from cma import CMAEvolutionStrategy  # noqa: PLC0415  # imports a second's worth of statistics
        self._steps = least_step, step
        options = {
            "randn": lambda *shape: generator.standard_normal(shape),
            "seed": np.nan,
            "verbose": -9,
            "verb_log": 0,
            "popsize": population,
        }
        self._search = CMAEvolutionStrategy(np.zeros(dimension), step, options)
        self._origin, self._metric = np.zeros(dimension), np.eye(dimension)
        self._asked: list[NDArray[np.float64]] = []

    @property
    def deviation(self) -> float:
        """Current step size σ."""
        return float(self._search.sigma)

    @property
    def mean(self) -> NDArray[np.float64]:
        """Centre (dim,) of the current distribution."""
        return self._origin + self._metric @ np.asarray(self._search.mean, np.float64)

    def restart(self, origin: NDArray[np.float64], metric: NDArray[np.float64]) -> None:
        """Moves the mean to the prediction; covariance and step size continue from the last frame."""
        self._origin, self._metric = origin, metric
        self._search.mean = np.zeros_like(self._search.mean)
        self._search.sigma = float(np.clip(self._search.sigma, *self._steps))

    def ask(self) -> NDArray[np.float64]:
        """The next candidates (population, dim)."""
        self._asked = self._search.ask()
        return self._origin + np.asarray(self._asked) @ self._metric.T

    def tell(self, costs: NDArray[np.float64]) -> None:
        """Learns the costs (population,) of the candidates that `ask` returned."""
        self._search.tell(self._asked, costs.tolist())

    def advance(self, problem: Problem, course: Course, budget: Budget) -> None:
        """One generation."""
        advance_by_one(self, problem, course, budget)
