"""A search whose own time is measured: without costs and derivatives, which the problem computes."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.optimizers.base import Budget, FrameProblem, Optimizer, RunningSearch, Search
from abs_service.tracker.posterior.curvature import Quadratic
from abs_service.tracker.posterior.linearized_cost import LinearizedCost
from abs_service.tracker.terms.sensor_fit import SensorFit
from abs_service.tracking.plan import OptimizerSettings

Answer = TypeVar("Answer")


@dataclass
class Clocked:
    """A problem, and the processor time of its answers [s]."""

    problem: FrameProblem
    dimension: int
    spent_s: float = 0.0

    def linearize(self, theta: NDArray[np.float64]) -> LinearizedCost:
        """See `FrameProblem`."""
        return self._clocked(lambda: self.problem.linearize(theta))

    def prior(self, theta: NDArray[np.float64]) -> Quadratic:
        """See `FrameProblem`."""
        return self._clocked(lambda: self.problem.prior(theta))

    def fits(self, theta: NDArray[np.float64]) -> tuple[SensorFit, ...]:
        """See `FrameProblem`."""
        return self._clocked(lambda: self.problem.fits(theta))

    def shown_at(self, theta: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """See `FrameProblem`."""
        return self._clocked(lambda: self.problem.shown_at(theta))

    def _clocked(self, ask: Callable[[], Answer]) -> Answer:
        begin = time.thread_time()
        answer = ask()
        self.spent_s += time.thread_time() - begin
        return answer


@dataclass
class Watched:
    """Settings of a search, and the processor time of every frame's search without costs and derivatives [s]."""

    settings: OptimizerSettings
    took_s: list[float] = field(default_factory=list)

    def build(self, dimension: int, generator: np.random.Generator) -> Optimizer:
        """The search, watched."""
        return WatchedSearch(self.settings.build(dimension, generator), self)


@dataclass
class WatchedSearch:
    """An `Optimizer` that measures the time between the costs that it receives and the candidates that it asks for."""

    search: Optimizer
    watched: Watched

    def follow(self, problem: FrameProblem, start: NDArray[np.float64], budget: Budget) -> Search:
        """See `Optimizer`."""
        clocked, own_s = Clocked(problem, problem.dimension), 0.0
        begin = time.thread_time()
        running = RunningSearch(self.search.follow(clocked, start, budget))
        while running.outcome is None:
            thetas = running.ask()
            own_s += time.thread_time() - begin
            costs = yield thetas
            begin = time.thread_time()
            running.tell(costs)
        self.watched.took_s.append(own_s + time.thread_time() - begin - clocked.spent_s)
        return running.outcome

    def explore(self, problem: FrameProblem, start: NDArray[np.float64], budget: Budget) -> Search:
        """See `Optimizer`."""
        return self.search.explore(problem, start, budget)
