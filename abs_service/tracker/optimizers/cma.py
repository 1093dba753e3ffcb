"""CMA-ES by its authors' library, pycma: the reference search."""

import warnings
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray


@dataclass(frozen=True)
class Settings:
    """TOML keys of the search.

    Attributes:
        population: candidates per generation; 0 lets CMA-ES choose 4 + 3 ln dim.
        generations: generations per frame at most.
        step: standard deviation of the first candidates, in posterior deviations of the parameters.
        least_step: the step size never starts a frame below this, so that the search can follow motion.
    """

    population: Annotated[int, Ge(0)] = 0
    generations: Annotated[int, Ge(1)] = 20
    step: Annotated[float, Gt(0)] = 1.0
    least_step: Annotated[float, Gt(0)] = 0.5

    def build(self, dimension: int, generator: np.random.Generator) -> "Cma":
        """A search in `dimension` dimensions that draws from `generator`."""
        return Cma(self, dimension, generator)


class Cma:
    """Mean, step size and covariance of one frame start the next; see `Optimizer` for the interface."""

    def __init__(self, settings: Settings, dimension: int, generator: np.random.Generator):
        with warnings.catch_warnings():  # pycma regrets that it cannot plot
            warnings.simplefilter("ignore")
            from cma import CMAEvolutionStrategy  # noqa: PLC0415  # imports a second's worth of statistics
        self.generations = settings.generations
        self._settings = settings
        options = {
            "randn": lambda *shape: generator.standard_normal(shape),
            "seed": np.nan,
            "verbose": -9,
            "verb_log": 0,
        }
        if settings.population:
            options["popsize"] = settings.population
        self._search = CMAEvolutionStrategy(np.zeros(dimension), settings.step, options)

    @property
    def deviation(self) -> float:
        """Current step size σ."""
        return float(self._search.sigma)

    @property
    def mean(self) -> NDArray[np.float64]:
        """Centre (dim,) of the current distribution."""
        return np.asarray(self._search.mean, np.float64)

    def restart(self) -> None:
        """Moves the mean to the prediction, ξ = 0; covariance and step size continue from the last frame."""
        self._search.mean = np.zeros_like(self._search.mean)
        self._search.sigma = float(np.clip(self._search.sigma, self._settings.least_step, self._settings.step))

    def ask(self) -> NDArray[np.float64]:
        """The next candidates (population, dim)."""
        return np.asarray(self._search.ask())

    def tell(self, candidates: NDArray[np.float64], costs: NDArray[np.float64]) -> None:
        """Updates mean, step size and covariance."""
        self._search.tell(list(candidates), costs.tolist())
