"""CMA-ES, compiled: full covariance, evolution paths, what one frame teaches the next."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.fused_cost import Step
from abs_service.tracker.optimizers.base import Budget, Problem
from abs_service.tracker.optimizers.search.cma_update import Constants, absorb, normal_quantiles, propose, update
from abs_service.tracker.optimizers.search.convergence import Course
from abs_service.tracker.optimizers.search.evolution import (
    Evolution,
    EvolutionSettings,
    Schedule,
    advance_by_one,
    usual_population,
)
from abs_service.tracker.optimizers.search.generation_loop import Distribution, generations
from calib.jit import composed


@dataclass(frozen=True)
class Settings(EvolutionSettings):
    """TOML keys of the search."""

    def build(self, dimension: int, generator: np.random.Generator) -> Evolution:
        """A search in `dimension` dimensions that draws from `generator`."""
        make = partial(CmaEs, dimension, generator, self.least_step)
        population = self.population or usual_population(dimension)
        schedule = Schedule("cma_es", self.generations, self.tolerance)
        return Evolution(schedule, make, population, self.step, self.restarts)


#: Share of the covariance that may be new before candidates are drawn with it.
LEARNT = 0.1

#: Candidates that are judged at once, by default: less than a millisecond, or a few with several sensors.
AT_ONCE = 256

#: Share of the covariance that begins every frame anew, as the identity.
FORGOTTEN = 0.5


class CmaEs:
    """Step size and covariance of one frame start the next; see `Strategy` for the interface.

    Candidates are drawn with the Cholesky factor of the covariance in place of its symmetric root, which distributes
    them equally and costs a fraction of an eigendecomposition. Both evolution paths, and what is learnt of the
    covariance, live in the coordinates of that factor, in which the covariance was the identity when the factor was
    made (Krause, Arbonès, Igel: CMA-ES with optimal covariance update and storage complexity, 2016): one product leads
    from normal numbers to Θ. The factor is a new one when a share `LEARNT` of the covariance may be new; with few
    parameters that is every generation.

    Args:
        dimension: of Θ.
        generator: source of all randomness; its bits come 64 at a time, as those of NumPy's default do.
        least_step: the step size never starts a frame below this.
        population: candidates per generation.
        step: standard deviation of the first candidates.
        at_once: so many candidates at most are judged before the search looks at the clock again, or those of one
            generation. If they are those of several, a loop over generations is compiled for the problem.
    """

    def __init__(
        self,
        dimension: int,
        generator: np.random.Generator,
        least_step: float,
        population: int,
        step: float,
        at_once: int = AT_ONCE,
    ):
        self._bits = generator.bit_generator
        self._steps = least_step, step
        self._at_once = at_once // population
        self._constants = Constants(dimension, population)
        self._sigma = step
        self._generation = 0
        self._gap = max(1, int(LEARNT / (self._constants.rates[2] + self._constants.rates[3])))
        self._z = np.zeros((population, dimension), np.float32)
        # Single precision takes half the time, and nobody needs to know a step better.
        axes, learnt = np.eye(dimension, dtype=np.float32), np.eye(dimension, dtype=np.float32)
        self._own = Distribution(np.zeros(dimension), axes, learnt, np.eye(dimension), np.zeros((2, dimension)))

    @property
    def deviation(self) -> float:
        """Current step size σ."""
        return self._sigma

    @property
    def mean(self) -> NDArray[np.float64]:
        """Centre (dim,) of the current distribution."""
        return self._own.mean.copy()

    def restart(self, origin: NDArray[np.float64], metric: NDArray[np.float64]) -> None:
        """Moves the mean to the prediction; half of the covariance, and the step size, continue.

        In ξ every frame's cost is nearly round by itself. What long searches learn beyond that is how rough the cost of
        one frame is: where they have narrowed the covariance frame after frame, they cannot follow motion any more.
        """
        mean, axes, learnt, old, paths = self._own
        mean[:] = origin
        self._sigma = float(np.clip(self._sigma, *self._steps))
        absorb(learnt, old, paths[1], axes)
        covariance = (1 - FORGOTTEN) * old @ old.T
        covariance.flat[:: len(covariance) + 1] += FORGOTTEN
        factor = np.asarray(np.linalg.cholesky(covariance), np.float64)
        paths[1] = np.linalg.solve(factor, old @ paths[1])
        old[:] = factor
        axes[:] = np.matmul(factor.T, metric.T)

    def ask(self) -> NDArray[np.float64]:
        """The next candidates (population, dim)."""
        thetas = np.empty(self._z.shape)
        propose(self._draw(1), normal_quantiles(), self._own.axes, self._sigma, self._own.mean, self._z, thetas)
        return thetas

    def tell(self, costs: NDArray[np.float64]) -> None:
        """Learns the costs (population,) of the candidates that `ask` returned."""
        self._generation += 1
        mean, axes, learnt, factor, paths = self._own
        weights, rates = self._constants.weights, self._constants.rates
        self._sigma = update(self._z, axes, costs, weights, rates, self._generation, self._sigma, mean, paths, learnt)
        if self._generation % self._gap == 0:
            absorb(learnt, factor, paths[1], axes)

    def advance(self, problem: Problem, course: Course, budget: Budget) -> None:
        """As many generations at once as may be where a candidate's cost can be compiled into the loop, else one."""
        enough = 1 if budget.exhausted() else -(-budget.left // len(self._z))
        count = min(self._at_once, course.left, enough)
        if problem.judge is None or count <= 1:
            advance_by_one(self, problem, course, budget)
        else:
            before = course.done
            self._advance_in_one_loop(problem.judge, course, count)
            budget.spend((course.done - before) * len(self._z), generations=course.done - before)

    def _advance_in_one_loop(self, judge: Step, course: Course, count: int) -> None:
        before = course.done
        advanced: Callable[..., tuple[int, float, bool]] = composed(generations, judged=judge.kernel)
        course.done, self._sigma, course.steady = advanced(
            self._own,
            self._constants.weights,
            self._constants.rates,
            self._generation,
            self._gap,
            self._sigma,
            self._draw(count),
            normal_quantiles(),
            course.least,
            before,
            course.tolerance,
            judge.arguments,
        )
        self._generation += course.done - before

    def _draw(self, count: int) -> NDArray[np.uint16]:
        """Random bits for so many generations (count · population · dim,)."""
        size = count * self._z.size
        return self._bits.random_raw((size + 3) // 4).view(np.uint16)[:size]
