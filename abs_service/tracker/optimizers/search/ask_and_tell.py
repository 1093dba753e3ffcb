"""Searches of one frame with an ask-and-tell sampler such as CMA-ES: warm start, generations, restarts."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, Protocol

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from abs_service.tracker.optimizers.base import Budget, Costs, FrameProblem, Outcome, Search, StartSearch, Stop
from abs_service.tracker.optimizers.search.convergence import ConvergenceMonitor
from abs_service.tracker.posterior.curvature import newton_step, search_metric
from abs_service.tracker.terms.agreement import outlier_share

#: Outlier share below which a solution is accepted without further exploration.
ACCEPTED_OUTLIERS = 0.1

#: Standard deviation of the first candidates of an exploration, in deviations of the priors.
WIDE = 2.0

#: Minimum difference of cost between two minima [nats]. The cost of one minimum varies by about ten, because vertices
#: that move from pixel to pixel meet the noise of each.
SIGNIFICANT = 20.0


class Sampler(Protocol):
    """An ask-and-tell sampler over ξ ∈ R^dim with Θ = origin + metric ξ; the curvature in ξ is about one."""

    @property
    def deviation(self) -> float:
        """Current standard deviation of the candidates in ξ."""
        ...

    @property
    def mean(self) -> NDArray[np.float64]:
        """Mean (dim,) of the current distribution, in Θ."""
        ...

    def restart(self, origin: NDArray[np.float64], metric: NDArray[np.float64]) -> None:
        """Starts a frame at ξ = 0 with step size and covariance of the last frame."""
        ...

    def ask(self) -> NDArray[np.float64]:
        """The next candidates (population, dim), in Θ."""
        ...

    def tell(self, costs: Costs) -> None:
        """Updates the distribution with the costs (population,) of the last candidates."""
        ...


#: Makes a sampler with a population size and an initial standard deviation.
MakeSampler = Callable[[int, float], Sampler]


@dataclass(frozen=True)
class Schedule:
    """Limits of one search, which `Outcome.searcher` names; `ConvergenceMonitor` has the tolerance [nats]."""

    name: str
    generations: int
    tolerance: float


#: Of each search of an exploration.
_EXPLORATION = Schedule("exploration", generations=60, tolerance=SIGNIFICANT)


@dataclass(frozen=True)
class AskAndTellSettings:
    """TOML keys of a search by generations.

    Attributes:
        population: candidates per generation; 0: 4 + 3 ln dim, the default of CMA-ES.
        generations: maximum number of generations per frame.
        step: initial standard deviation of the candidates, in posterior deviations of the parameters.
        minimum_step: minimum step size at the start of a frame, so that the search can follow motion.
        tolerance: the search has converged when costs differ by less than this [nats], within a generation and between
            the minima of five.
        restarts: maximum number of times that the population doubles in the first two frames.
    """

    population: Annotated[int, Ge(0)] = 0
    generations: Annotated[int, Ge(1)] = 20
    step: Annotated[float, Gt(0)] = 1.0
    minimum_step: Annotated[float, Gt(0)] = 0.5
    tolerance: Annotated[float, Gt(0)] = 0.5
    restarts: Annotated[int, Ge(0)] = 3


class AskAndTell:
    """An `Optimizer` with one sampler; its step size and covariance continue from frame to frame.

    Args:
        name: of the sampler, see `Outcome.searcher`.
        settings: of the search.
        dimension: of Θ.
        make: makes samplers.
    """

    def __init__(self, name: str, settings: AskAndTellSettings, dimension: int, make: MakeSampler):
        self._schedule = Schedule(name, settings.generations, settings.tolerance)
        self._make = make
        self._population = settings.population or default_population(dimension)
        self._restarts = settings.restarts
        self._sampler = make(self._population, settings.step)

    def follow(self, problem: FrameProblem, start: NDArray[np.float64], budget: Budget) -> Search:
        """Searches in the metric of the curvature, from the best of none, half and all of a Newton step."""
        linearized = problem.linearize(start)
        metric = search_metric(linearized.quadratic)
        step = newton_step(linearized.quadratic, metric)
        origins = np.stack([start, start + step / 2, start + step])
        costs = yield origins
        best = int(np.argmin(costs))
        found = yield from sample(origins[best], float(costs[best]), metric, self._sampler, self._schedule, budget)
        return replace(found, linearized=linearized)

    def explore(self, problem: FrameProblem, start: NDArray[np.float64], budget: Budget) -> Search:
        """Follows, then samples the priors with growing populations."""
        return explore(problem, start, self.follow, self._make, self._population, self._restarts, budget)


def default_population(dimension: int) -> int:
    """Default population of CMA-ES."""
    return 4 + int(3 * np.log(dimension))


def sample(
    origin: NDArray[np.float64],
    cost: float,
    metric: NDArray[np.float64],
    sampler: Sampler,
    schedule: Schedule,
    budget: Budget,
) -> Search:
    """Asks and tells a sampler over ξ with Θ = origin + metric ξ, at least once; the better of mean and origin."""
    sampler.restart(origin, metric)
    stop, monitor = None, ConvergenceMonitor(schedule.generations, schedule.tolerance)
    while not monitor.is_over and stop is None:
        costs = yield sampler.ask()
        sampler.tell(costs)
        monitor.add(costs)
        budget.generations += 1
        stop = None if monitor.is_over else budget.exhausted()
    ended = Stop.CONVERGED if monitor.converged else Stop.GENERATIONS
    theta = sampler.mean
    cost_of_mean = float((yield theta[None])[0])
    if cost_of_mean > cost:
        theta, cost_of_mean = origin, cost
    return Outcome(theta, cost_of_mean, schedule.name, stop or ended, sampler.deviation)


def explore(
    problem: FrameProblem,
    start: NDArray[np.float64],
    follow: StartSearch,
    make: MakeSampler,
    population: int,
    restarts: int,
    budget: Budget,
) -> Search:
    """Follows, then samples the priors with growing populations, until two in a row find nothing better.

    Nothing is sampled if the first solution has few outliers.
    Auger, Hansen: A restart CMA evolution strategy with increasing population size (2005), with the priors in place of
    a box to sample from.

    Args:
        problem: the cost.
        start: prediction (dim,).
        follow: local search, from the best sample.
        make: makes samplers.
        population: of the first search.
        restarts: maximum number of times that the population doubles.
        budget: for all searches together.
    """
    best = (yield from follow(problem, start, budget)).compared(problem)
    if outlier_share(best.fits) < ACCEPTED_OUTLIERS:
        return best
    start_cost = float((yield start[None])[0])
    metric = search_metric(problem.prior(start))
    failures = 0
    for restart in range(restarts + 1):
        if failures == 2 or budget.exhausted():
            break
        sampler = make(population << restart, WIDE)
        sampled = yield from sample(start, start_cost, metric, sampler, _EXPLORATION, budget)
        found = yield from follow(problem, sampled.theta, budget)
        failures = 0 if found.cost < best.cost - SIGNIFICANT else failures + 1
        best = found if failures == 0 else replace(best, linearized=found.linearized)
    return best
