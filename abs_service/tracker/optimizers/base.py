"""The optimiser interface: a search asks for the cost of candidates and returns the best theta within a budget.

A search is a generator: it yields candidates, is sent their costs, and returns an `Outcome`. The tracker drives it by
ask and tell (`RunningSearch`), so every optimiser has the same loop. `cma.py` is the one to copy.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.posterior.curvature import Quadratic
from abs_service.tracker.posterior.linearized_cost import LinearizedCost
from abs_service.tracker.terms.sensor_fit import SensorFit

#: Costs (population,) [nats] of candidates (population, dim).
Costs = NDArray[np.float64]


class FrameProblem(Protocol):
    """The cost of one frame near a theta: derivatives and outliers for the searches that use them."""

    @property
    def dimension(self) -> int:
        """Number of parameters."""
        ...

    def linearize(self, theta: NDArray[np.float64]) -> LinearizedCost:
        """The cost near theta (dim,), with its Gauss–Newton approximation."""
        ...

    def prior(self, theta: NDArray[np.float64]) -> Quadratic:
        """Gauss–Newton approximation of the priors alone near theta (dim,)."""
        ...

    def fits(self, theta: NDArray[np.float64]) -> tuple[SensorFit, ...]:
        """Agreement of every contributing sensor with theta (dim,)."""
        ...

    def shown_at(self, theta: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Parameters (dim,) where images show the surface: theta (dim,), a search's end, or others; None if unknown."""
        ...


class Stop(StrEnum):
    """Reason for the end of a search."""

    NOTHING = "nothing"  # no search
    CONVERGED = "converged"
    GENERATIONS = "generations"
    EVALUATIONS = "evaluations"
    TIME = "time"


class Budget:
    """Budget of evaluations and time of one frame, and its consumption.

    Args:
        limit: see below.
        in_time: False when the time is up.

    Attributes:
        limit: maximum number of cost evaluations; a generation that has begun is completed.
        generations: of populations, and accepted steps of descents.
        evaluations: number of cost evaluations.
    """

    def __init__(self, limit: int, in_time: Callable[[], bool]):
        self.limit = limit
        self.generations = 0
        self.evaluations = 0
        self._in_time = in_time

    def exhausted(self) -> Stop | None:
        """Reason to stop; None while there is budget."""
        if self.evaluations >= self.limit:
            return Stop.EVALUATIONS
        return None if self._in_time() else Stop.TIME


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """Result of a search.

    Attributes:
        theta: the parameters (dim,) of minimum cost.
        cost: their cost [nats].
        searcher: "levenberg_marquardt", "cma" or "cma_es".
        stop: reason for the end.
        deviation: step size at the end, in deviations of the posterior.
        linearized: the newest linearisation of the cost that the search made, from which the covariance of theta is
            made if it holds there; None if it made none.
        fits: agreement of the sensors with theta; empty if the search did not ask for it.
        is_start: True if theta is no optimum, but where images show the surface: another search is to begin there.
            The cost is that of the search's end then, above that of theta.
    """

    theta: NDArray[np.float64]
    cost: float
    searcher: str
    stop: Stop
    deviation: float
    linearized: LinearizedCost | None = None
    fits: tuple[SensorFit, ...] = ()
    is_start: bool = False

    def compared(self, problem: FrameProblem) -> "Outcome":
        """The same with the agreement of the sensors."""
        return self if self.fits else replace(self, fits=problem.fits(self.theta))


#: Yields candidates (population, dim), receives their costs (population,), returns the outcome.
Search = Generator[NDArray[np.float64], Costs, Outcome]


class RunningSearch:
    """A search in the form of ask and tell.

    Args:
        search: a search that has not begun; it asks at least once.

    Attributes:
        outcome: None while the search goes on.
    """

    def __init__(self, search: Search):
        self.outcome: Outcome | None = None
        self._search = search
        self._thetas = next(search)

    def ask(self) -> NDArray[np.float64]:
        """Candidates (population, dim) whose costs the search waits for."""
        return self._thetas

    def tell(self, costs: Costs) -> None:
        """Passes the costs (population,) of the candidates on; the search asks for others, or ends."""
        try:
            self._thetas = self._search.send(costs)
        except StopIteration as ended:
            self.outcome = ended.value


#: Starts a search of a problem at parameters (dim,).
StartSearch = Callable[[FrameProblem, NDArray[np.float64], Budget], Search]


class Optimizer(Protocol):
    """A search for every frame; its state in one frame starts the next."""

    def follow(self, problem: FrameProblem, start: NDArray[np.float64], budget: Budget) -> Search:
        """Warm start: searches near the predicted parameters (dim,)."""
        ...

    def explore(self, problem: FrameProblem, start: NDArray[np.float64], budget: Budget) -> Search:
        """Cold start: searches wherever the priors allow around start (dim,)."""
        ...
