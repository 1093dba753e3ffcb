"""A descent where the last frame's solution is near, CMA-ES where the likelihood says that it is not."""

from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Interval
from numpy.typing import NDArray

from abs_service.tracker.optimizers.base import Budget, Outcome, Problem
from abs_service.tracker.optimizers.cma_es import CmaEs
from abs_service.tracker.optimizers.search.evolution import (
    SIGNIFICANT,
    Make,
    Schedule,
    evolve,
    explore,
    usual_population,
)
from abs_service.tracker.optimizers.search.levenberg_marquardt import descend
from abs_service.tracker.posterior.curvature import search_metric

#: Step size with which CMA-ES goes on in the next frame, at least, as a share of the first one.
LEAST_STEP = 0.5

#: Weight of a frame in what is usual.
MEMORY = 0.03


@dataclass(frozen=True)
class Settings:
    """TOML keys of the search.

    Attributes:
        steps: of the descent per frame at most.
        tolerance: the descent ends with a step that promises less than this per parameter [nats]; the noise of a frame
            throws the estimate by ½.
        population: candidates per generation of CMA-ES; 0 lets it choose 4 + 3 ln dim.
        generations: generations per frame at most, where CMA-ES takes over.
        step: standard deviation of its first candidates, in deviations of the priors.
        far: CMA-ES takes over when the descent leaves so much more of the measurements unexplained, as a share of all,
            than lately.
        near: it hands back when the share is less than this above that of lately.
        restarts: how often the population may double in the first frame, where the object is searched for widely.
    """

    steps: Annotated[int, Ge(1)] = 12
    tolerance: Annotated[float, Gt(0)] = 0.2
    population: Annotated[int, Ge(0)] = 0
    generations: Annotated[int, Ge(1)] = 25
    step: Annotated[float, Gt(0)] = 1.0
    far: Annotated[float, Interval(gt=0, lt=1)] = 0.03
    near: Annotated[float, Interval(gt=0, lt=1)] = 0.015
    restarts: Annotated[int, Ge(0)] = 3

    def build(self, dimension: int, generator: np.random.Generator) -> "Hybrid":
        """A search in `dimension` dimensions that draws from `generator`."""
        # It samples so rarely that nobody should wait for the compiler because of that.
        make = partial(CmaEs, dimension, generator, LEAST_STEP * self.step, at_once=1)
        return Hybrid(self, make, self.population or usual_population(dimension))


class Hybrid:
    """See `Optimizer` for the interface.

    Args:
        settings: its settings.
        make: makes the strategies that sample.
        population: candidates per generation.
    """

    def __init__(self, settings: Settings, make: Make, population: int):
        self._settings = settings
        self._make = make
        self._population = population
        self._strategy = make(population, settings.step)
        self._schedule = Schedule("cma_es", settings.generations, SIGNIFICANT)
        self._usual = 1.0
        self._searching = False

    def follow(self, problem: Problem, start: NDArray[np.float64], budget: Budget) -> Outcome:
        """Descends; where that explains less than lately, samples what the priors allow and descends from there."""
        found = self._descend(problem, start, budget)
        unexplained = problem.unexplained(found.theta)
        limit = self._settings.near if self._searching else self._settings.far
        if unexplained > self._usual + limit:
            found = self._take_over(problem, start, found, budget)
            unexplained = problem.unexplained(found.theta)
        self._learn(unexplained)
        return found

    def explore(self, problem: Problem, start: NDArray[np.float64], budget: Budget) -> Outcome:
        """Descends, and samples the priors with growing populations for something better."""
        restarts = self._settings.restarts
        found = explore(problem, start, self._descend, self._make, self._population, restarts, budget)
        self._usual = problem.unexplained(found.theta)
        return found

    def _descend(self, problem: Problem, start: NDArray[np.float64], budget: Budget) -> Outcome:
        tolerance = self._settings.tolerance * problem.dimension
        return descend(problem, start, self._settings.steps, tolerance, budget)

    def _take_over(self, problem: Problem, start: NDArray[np.float64], near: Outcome, budget: Budget) -> Outcome:
        """The better of what the descent found and of what CMA-ES finds, with a descent from there."""
        if not self._searching:
            self._strategy = self._make(self._population, self._settings.step)
        metric = search_metric(problem.prior(start))
        sampled = evolve(problem, start, np.inf, metric, self._strategy, self._schedule, budget)
        polished = self._descend(problem, sampled.theta, budget)
        if polished.cost < near.cost - SIGNIFICANT:
            return replace(sampled, theta=polished.theta, cost=polished.cost)
        return near

    def _learn(self, unexplained: float) -> None:
        """What is usual follows slowly; a worse state that lasts becomes usual, so that a search in vain ends."""
        self._searching = unexplained > self._usual + self._settings.near
        self._usual += MEMORY * (unexplained - self._usual)
