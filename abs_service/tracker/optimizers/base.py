"""What an optimiser is: a search for the minimum of a frame's cost, within a budget."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.fused_cost import Step
from abs_service.tracker.posterior.curvature import Quadratic


class Problem(Protocol):
    """The cost of a frame over Θ: the negative logarithm of likelihood times priors.

    Attributes:
        dimension: number of parameters.
    """

    dimension: int

    @property
    def judge(self) -> Step | None:
        """What one candidate costs, as a step that takes parameters (1, dim); None if only `cost` can tell."""
        ...

    def cost(self, thetas: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cost (population,) of every row of `thetas` (population, dim), in nats."""
        ...

    def linearize(self, theta: NDArray[np.float64]) -> Quadratic:
        """The cost near theta (dim,)."""
        ...

    def prior(self, theta: NDArray[np.float64]) -> Quadratic:
        """The part of the cost near theta (dim,) that no measurement has a say in."""
        ...

    def unexplained(self, theta: NDArray[np.float64]) -> float:
        """Share of the measurements that their noise does not explain at theta (dim,), 0…1."""
        ...


class Stop(StrEnum):
    """Why a search ended."""

    NOTHING = "nothing"  # there was nothing to search for
    CONVERGED = "converged"
    GENERATIONS = "generations"
    EVALUATIONS = "evaluations"
    TIME = "time"


class Budget:
    """What a frame may take, and what it has taken so far.

    Args:
        limit: how often the cost may be computed; a generation that has begun is completed.
        in_time: whether there is time for more.

    Attributes:
        generations: of populations, and steps of descents.
        evaluations: how often the cost was computed.
    """

    def __init__(self, limit: int, in_time: Callable[[], bool]):
        self.generations = 0
        self.evaluations = 0
        self._limit = limit
        self._in_time = in_time

    def spend(self, evaluations: int, generations: int = 0) -> None:
        """Enters what was done."""
        self.evaluations += evaluations
        self.generations += generations

    @property
    def left(self) -> int:
        """How often the cost may still be computed."""
        return max(0, self._limit - self.evaluations)

    def exhausted(self) -> Stop | None:
        """Why there must not be more; None if there may."""
        if self.evaluations >= self._limit:
            return Stop.EVALUATIONS
        return None if self._in_time() else Stop.TIME


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What a search found.

    Attributes:
        theta: the parameters (dim,) of least cost.
        cost: what they cost [nats].
        searcher: what found them: "levenberg_marquardt", "cma", "cma_es".
        stop: why it ended.
        deviation: step size at the end, in deviations of the posterior.
    """

    theta: NDArray[np.float64]
    cost: float
    searcher: str
    stop: Stop
    deviation: float


#: A search of a problem that begins at parameters (dim,).
Search = Callable[[Problem, NDArray[np.float64], Budget], Outcome]


class Optimizer(Protocol):
    """A search that is asked frame after frame."""

    def follow(self, problem: Problem, start: NDArray[np.float64], budget: Budget) -> Outcome:
        """Searches near start (dim,), where the last frames say that the object is."""
        ...

    def explore(self, problem: Problem, start: NDArray[np.float64], budget: Budget) -> Outcome:
        """Searches wherever the priors allow around start (dim,), for an object that nothing is known of yet."""
        ...
