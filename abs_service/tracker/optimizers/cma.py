"""CMA-ES by its authors' library, pycma: the reference, and the optimiser to copy.

Too slow for live tracking in more than a few dimensions.
"""

import warnings
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.optimizers.base import Costs
from abs_service.tracker.optimizers.search.ask_and_tell import AskAndTell, AskAndTellSettings


@dataclass(frozen=True)
class Settings(AskAndTellSettings):
    """TOML keys of the search."""

    def build(self, dimension: int, generator: np.random.Generator) -> AskAndTell:
        """A search in `dimension` dimensions that draws from `generator`."""
        make = partial(PycmaSampler, dimension, generator, self.minimum_step)
        return AskAndTell("cma", self, dimension, make)


class _Pycma(Protocol):
    """The used part of pycma's search, which has no types: to infer them takes the type checker ten seconds."""

    sigma: float
    mean: NDArray[np.float64]

    def ask(self) -> list[NDArray[np.float64]]: ...

    def tell(self, solutions: list[NDArray[np.float64]], function_values: list[float]) -> None: ...


class PycmaSampler:
    """A `Sampler`: pycma. Step size and covariance of one frame start the next.

    Args:
        dimension: of Θ.
        generator: source of all randomness.
        minimum_step: minimum step size at the start of a frame.
        population: candidates per generation.
        step: initial standard deviation of the candidates.
    """

    def __init__(
        self, dimension: int, generator: np.random.Generator, minimum_step: float, population: int, step: float
    ):
        with warnings.catch_warnings():  # pycma warns that it cannot plot
            warnings.simplefilter("ignore")
            pycma = import_module("cma")  # importing it takes a second
        self._steps = minimum_step, step
        options: dict[str, Any] = {
            "randn": lambda *shape: generator.standard_normal(shape),
            "seed": np.nan,
            "verbose": -9,
            "verb_log": 0,
            "popsize": population,
        }
        self._search: _Pycma = pycma.CMAEvolutionStrategy(np.zeros(dimension), step, options)
        self._origin, self._metric = np.zeros(dimension), np.eye(dimension)
        self._asked: list[NDArray[np.float64]] = []

    @property
    def deviation(self) -> float:
        """Current step size σ."""
        return float(self._search.sigma)

    @property
    def mean(self) -> NDArray[np.float64]:
        """Mean (dim,) of the current distribution."""
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

    def tell(self, costs: Costs) -> None:
        """Updates the distribution with the costs (population,) of the last candidates."""
        self._search.tell(self._asked, costs.tolist())
