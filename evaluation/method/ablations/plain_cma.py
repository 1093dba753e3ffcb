"""CMA-ES as in the paper, plain over Θ, and with what this product adds to it one by one, by pycma.

The paper: mean, step size and covariance of one frame start the next. Added since: the motion prediction as start, a
Newton step from there, and the metric of the curvature (docs/decisions/0006). The cost, priors included, the stop
criterion and the library are the same for all.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.optimizers import cma, cma_es, hybrid
from abs_service.tracker.optimizers.base import Budget, FrameProblem, Optimizer, Search
from abs_service.tracker.optimizers.cma import PycmaSampler
from abs_service.tracker.optimizers.search.ask_and_tell import MakeSampler, Schedule, default_population, sample
from abs_service.tracker.posterior.curvature import newton_step, search_metric
from abs_service.tracking.plan import OptimizerSettings

Array = NDArray[np.float64]

#: Θ at which a search may start (k, dim), and its metric (dim, dim), of a problem and a start (dim,).
Begin = Callable[[FrameProblem, Array], tuple[Array, Array]]

#: Deviation of a control point's first candidates in plain Θ [m]: of 2 to 20 mm, the best with 20 generations.
SCALE_M = 0.01

#: Smallest step size that a frame of the plain search begins with, in that unit: the last frame's, as in the paper; at
#: least half of it was worse.
PLAIN_MIN = 0.0

#: The same where a long search shall not begin with the small steps that the last frame's ended with.
WIDE = 0.5


def in_theta(problem: FrameProblem, start: Array) -> tuple[Array, Array]:
    """Plain: at the start, all parameters alike."""
    return start[None], SCALE_M * np.eye(len(start))


def after_newton(problem: FrameProblem, start: Array) -> tuple[Array, Array]:
    """Start at the best of none, half and all of a Newton step, all parameters alike."""
    quadratic = problem.linearize(start).quadratic
    shares = np.outer([0.0, 0.5, 1.0], newton_step(quadratic, search_metric(quadratic)))
    return start + shares, SCALE_M * np.eye(len(start))


def in_metric(problem: FrameProblem, start: Array) -> tuple[Array, Array]:
    """Given start, in the metric of the curvature."""
    return start[None], search_metric(problem.linearize(start).quadratic)


@dataclass(frozen=True)
class Settings:
    """CMA-ES that begins every frame in one of these ways.

    Attributes:
        begin: one of the functions above.
        population: candidates per generation; 0: 4 + 3 ln dim.
        generations: per frame at most.
        minimum_step: smallest initial step size of a frame, in the units of the metric; 0: that of the last frame.
    """

    begin: Begin
    population: int = 0
    generations: int = 20
    minimum_step: float = 0.5

    def build(self, dimension: int, generator: np.random.Generator) -> "CmaFrom":
        """A search in `dimension` dimensions that draws from `generator`."""
        schedule = Schedule("cma", self.generations, 0.5)
        make = partial(PycmaSampler, dimension, generator, self.minimum_step)
        return CmaFrom(self.begin, schedule, make, self.population or default_population(dimension))


class CmaFrom:
    """See `Optimizer` for the interface, and `Settings`."""

    def __init__(self, begin: Begin, schedule: Schedule, make: MakeSampler, population: int):
        self._begin, self._schedule = begin, schedule
        self._make = partial(make, population, 1.0)
        self._sampler = self._make()

    def follow(self, problem: FrameProblem, start: Array, budget: Budget) -> Search:
        """Continues with the step size and covariance of the last frame."""
        origins, metric = self._begin(problem, start)
        costs = yield origins
        best = int(np.argmin(costs))
        return (yield from sample(origins[best], float(costs[best]), metric, self._sampler, self._schedule, budget))

    def explore(self, problem: FrameProblem, start: Array, budget: Budget) -> Search:
        """Begins anew."""
        self._sampler = self._make()
        return self.follow(problem, start, budget)


@dataclass(frozen=True)
class FromLast:
    """A search that starts every frame at the solution of the last, not at the motion prediction.

    Attributes:
        search: the search.
    """

    search: OptimizerSettings

    def build(self, dimension: int, generator: np.random.Generator) -> "FromSolution":
        """A search in `dimension` dimensions that draws from `generator`."""
        return FromSolution(self.search.build(dimension, generator))


class FromSolution:
    """See `Optimizer` for the interface, and `FromLast`."""

    def __init__(self, search: Optimizer):
        self._search = search
        self._last: list[Array] = []

    def follow(self, problem: FrameProblem, start: Array, budget: Budget) -> Search:
        """Searches near the solution of the last frame."""
        return self._kept(self._search.follow(problem, self._last[0], budget))

    def explore(self, problem: FrameProblem, start: Array, budget: Budget) -> Search:
        """Explores around start."""
        return self._kept(self._search.explore(problem, start, budget))

    def _kept(self, search: Search) -> Search:
        outcome = yield from search
        self._last = [outcome.theta]
        return outcome


#: Rows that the goal refers to.
PAPER, HYBRID = "plain, from the last solution, the paper's budget", "a descent instead: hybrid"
TENTH = "plain, from the last solution, a tenth of the paper's generations"
PAPER_WIDE = f"{PAPER}, steps of {WIDE * SCALE_M * 1e3:.0f} mm at first"

#: Searches that begin where images show the print, if that is beside the prediction.
MATCHED: Mapping[str, OptimizerSettings] = {
    "cma, begun where images show the print": cma.Settings(),
    "hybrid, begun where images show the print: the default": hybrid.Settings(),
}


def additions(generations: int, population: int) -> Mapping[str, OptimizerSettings]:
    """CMA-ES as in the paper, then with each addition, by name; 20 generations of 15 candidates if nothing is said.

    Args:
        generations, population: the paper's budget.
    """
    return {
        PAPER: FromLast(Settings(in_theta, population, generations, PLAIN_MIN)),
        PAPER_WIDE: FromLast(Settings(in_theta, population, generations, WIDE)),
        TENTH: FromLast(Settings(in_theta, population, max(1, generations // 10), PLAIN_MIN)),
        "cma with a tenth of the paper's generations": cma.Settings(population, max(1, generations // 10)),
        "plain, from the last solution": FromLast(Settings(in_theta, minimum_step=PLAIN_MIN)),
        "plain, from the motion prediction": Settings(in_theta, minimum_step=PLAIN_MIN),
        "the same after a Newton step": Settings(after_newton, minimum_step=PLAIN_MIN),
        "from the motion prediction, in the metric": Settings(in_metric),
        "the same after a Newton step: cma": cma.Settings(),
        "compiled, half of the covariance kept: cma_es": cma_es.Settings(),
        HYBRID: hybrid.Settings(),
    }
