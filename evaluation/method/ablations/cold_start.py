"""Searches without a warm start, for ablations."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.optimizers.base import Budget, FrameProblem, Optimizer, Search
from abs_service.tracking.plan import OptimizerSettings


@dataclass(frozen=True)
class Forgetful:
    """A search that starts every frame at the motion prediction, without step size and covariance of the last frame.

    Attributes:
        search: the search whose state is reset.
    """

    search: OptimizerSettings

    def build(self, dimension: int, generator: np.random.Generator) -> "FromPrediction":
        """A search in `dimension` dimensions that draws from `generator`."""
        return FromPrediction(partial(self.search.build, dimension, generator))


@dataclass(frozen=True)
class Cold:
    """A search that starts every frame at the start of the first.

    Attributes:
        search: the search.
    """

    search: OptimizerSettings

    def build(self, dimension: int, generator: np.random.Generator) -> "FromRest":
        """A search in `dimension` dimensions that draws from `generator`."""
        return FromRest(partial(self.search.build, dimension, generator))


class FromPrediction:
    """See `Optimizer` for the interface, and `Forgetful`."""

    def __init__(self, make: Callable[[], Optimizer]):
        self._make = make

    def follow(self, problem: FrameProblem, start: NDArray[np.float64], budget: Budget) -> Search:
        """Searches near start with a search that is made for it."""
        return self._make().follow(problem, start, budget)

    def explore(self, problem: FrameProblem, start: NDArray[np.float64], budget: Budget) -> Search:
        """Explores with a search that is made for it."""
        return self._make().explore(problem, start, budget)


class FromRest:
    """See `Optimizer` for the interface, and `Cold`."""

    def __init__(self, make: Callable[[], Optimizer]):
        self._make = make
        self._rest: list[NDArray[np.float64]] = []

    def follow(self, problem: FrameProblem, start: NDArray[np.float64], budget: Budget) -> Search:
        """Searches near where the first frame began."""
        return self._make().follow(problem, self._rest[0], budget)

    def explore(self, problem: FrameProblem, start: NDArray[np.float64], budget: Budget) -> Search:
        """Explores around start, which is where all frames begin from then on."""
        self._rest = [start]
        return self._make().explore(problem, start, budget)
