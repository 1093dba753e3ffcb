"""How a strategy behind ask and tell searches a frame: in the metric of the curvature, from a Newton step."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Protocol

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from abs_service.tracker.optimizers.base import Budget, Outcome, Problem, Search, Stop
from abs_service.tracker.optimizers.search.convergence import Course
from abs_service.tracker.posterior.curvature import newton_step, search_metric

#: Share of unexplained measurements below which a solution is not doubted, and nothing else is looked for.
UNDOUBTED = 0.1

#: Standard deviation of the first candidates of an exploration, in deviations of the priors.
WIDE = 2.0

#: Another minimum has to be better by so much to be believed [nats]; the cost is rough by about ten, because vertices
#: that move from pixel to pixel meet the noise of each.
SIGNIFICANT = 20.0


class Strategy(Protocol):
    """A search behind ask and tell: in ξ ∈ R^dim, where the curvature of the cost is about one, told in Θ."""

    @property
    def deviation(self) -> float:
        """Current standard deviation of the candidates."""
        ...

    @property
    def mean(self) -> NDArray[np.float64]:
        """Centre (dim,) of the current distribution."""
        ...

    def restart(self, origin: NDArray[np.float64], metric: NDArray[np.float64]) -> None:
        """Begins a frame at ξ = 0 with what the last frame taught about step size and covariance.

        Args:
            origin, metric: Θ = origin + metric ξ, (dim,) and (dim, dim); 0 and the identity before the first frame.
        """
        ...

    def ask(self) -> NDArray[np.float64]:
        """The next candidates (population, dim)."""
        ...

    def tell(self, costs: NDArray[np.float64]) -> None:
        """Learns the costs (population,) of the candidates that `ask` returned."""
        ...

    def advance(self, problem: Problem, course: Course, budget: Budget) -> None:
        """Asks and tells, for one generation at least, and for no more than are left.

        Args:
            problem: the cost over Θ.
            course: of the search so far; the costs of every generation enter it.
            budget: every generation is entered.
        """
        ...


def advance_by_one(strategy: Strategy, problem: Problem, course: Course, budget: Budget) -> None:
    """Asks for one generation, has it judged, and tells what it costs; see `Strategy.advance`."""
    costs = problem.cost(strategy.ask())
    strategy.tell(costs)
    budget.spend(len(costs), generations=1)
    course.enter(costs)


#: Makes a strategy with a population and the standard deviation of its first candidates.
Make = Callable[[int, float], Strategy]


@dataclass(frozen=True)
class Schedule:
    """How long a search goes on.

    Attributes:
        name: what its outcomes are called.
        generations: at most.
        tolerance: it has converged when costs differ by less than this [nats], within a generation and between the best
            ones of several.
    """

    name: str
    generations: int
    tolerance: float


#: Of each search that explores.
_EXPLORATION = Schedule("exploration", generations=60, tolerance=SIGNIFICANT)


@dataclass(frozen=True)
class EvolutionSettings:
    """TOML keys of a search by generations.

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


class Evolution:
    """An `Optimizer` that asks a strategy; mean, step size and covariance of one frame start the next.

    Args:
        schedule: of each frame.
        make: makes its strategies.
        population: candidates per generation.
        step: standard deviation of the first candidates, in posterior deviations of the parameters.
        restarts: how often the population may double when exploring.
    """

    def __init__(self, schedule: Schedule, make: Make, population: int, step: float, restarts: int):
        self._schedule = schedule
        self._make = make
        self._population = population
        self._restarts = restarts
        self._strategy = make(population, step)

    def follow(self, problem: Problem, start: NDArray[np.float64], budget: Budget) -> Outcome:
        """Searches in the metric of the curvature, from a Newton step of which all, half or none is taken."""
        quadratic = problem.linearize(start)
        metric = search_metric(quadratic)
        step = newton_step(quadratic, metric)
        origins = np.stack([start, start + step / 2, start + step])
        costs = problem.cost(origins)
        budget.spend(len(origins))
        nearest = int(np.argmin(costs))
        return evolve(problem, origins[nearest], float(costs[nearest]), metric, self._strategy, self._schedule, budget)

    def explore(self, problem: Problem, start: NDArray[np.float64], budget: Budget) -> Outcome:
        """Follows, and samples the priors with growing populations for something better."""
        return explore(problem, start, self.follow, self._make, self._population, self._restarts, budget)


def usual_population(dimension: int) -> int:
    """Candidates per generation that CMA-ES takes by default."""
    return 4 + int(3 * np.log(dimension))


def evolve(
    problem: Problem,
    origin: NDArray[np.float64],
    cost: float,
    metric: NDArray[np.float64],
    strategy: Strategy,
    schedule: Schedule,
    budget: Budget,
) -> Outcome:
    """Lets a strategy search over ξ with Θ = origin + metric ξ, for one generation at least.

    Args:
        problem: the cost over Θ.
        origin, cost: where ξ is zero (dim,), and what it costs there [nats].
        metric: (dim, dim).
        strategy: is asked and told.
        schedule, budget: when it ends.

    Returns:
        The better of the origin and the strategy's mean.
    """
    strategy.restart(origin, metric)
    stop, course = None, Course(schedule.generations, schedule.tolerance)
    while course.left and stop is None:
        strategy.advance(problem, course, budget)
        stop = budget.exhausted() if course.left else None
    ended = Stop.CONVERGED if course.steady else Stop.GENERATIONS
    theta = strategy.mean
    found = float(problem.cost(theta[None])[0])
    budget.spend(1)
    if found > cost:
        theta, found = origin, cost
    return Outcome(theta, found, schedule.name, stop or ended, strategy.deviation)


def explore(
    problem: Problem,
    start: NDArray[np.float64],
    follow: Search,
    make: Make,
    population: int,
    restarts: int,
    budget: Budget,
) -> Outcome:
    """Follows, then samples what the priors allow with growing populations, until two in a row find nothing better.

    Nothing is sampled if the first solution explains the measurements.
    Auger, Hansen: A restart CMA evolution strategy with increasing population size (2005), with the priors in place of
    a box to sample from.

    Args:
        problem: the cost over Θ.
        start: where the priors expect the object (dim,).
        follow: what goes on from the best that was sampled.
        make: makes the strategies.
        population: of the first search.
        restarts: how often it may double.
        budget: for all searches together.
    """
    best = follow(problem, start, budget)
    if problem.unexplained(best.theta) < UNDOUBTED:
        return best
    origin_cost = float(problem.cost(start[None])[0])
    metric = search_metric(problem.prior(start))
    in_vain = 0
    for restart in range(restarts + 1):
        if in_vain == 2 or budget.exhausted():
            break
        strategy = make(population << restart, WIDE)
        sampled = evolve(problem, start, origin_cost, metric, strategy, _EXPLORATION, budget)
        found = follow(problem, sampled.theta, budget)
        in_vain = 0 if found.cost < best.cost - SIGNIFICANT else in_vain + 1
        best = found if in_vain == 0 else best
    return best
