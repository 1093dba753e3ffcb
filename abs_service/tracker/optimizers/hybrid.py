"""Levenberg–Marquardt from the prediction; CMA-ES over the priors when too many measurements become outliers."""

from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Interval
from numpy.typing import NDArray

from abs_service.tracker.optimizers.base import Budget, FrameProblem, Outcome, Search
from abs_service.tracker.optimizers.cma_es import CmaEsSampler
from abs_service.tracker.optimizers.search.ask_and_tell import (
    SIGNIFICANT,
    MakeSampler,
    Schedule,
    default_population,
    explore,
    sample,
)
from abs_service.tracker.optimizers.search.levenberg_marquardt import descend
from abs_service.tracker.posterior.curvature import search_metric
from abs_service.tracker.terms.agreement import disagreeing_colors, distances_share, outlier_share
from abs_service.tracker.terms.places.patches import SIZE

#: Minimum step size of CMA-ES at the start of a frame, as a share of the initial one.
MIN_STEP = 0.5

#: Vertices whose colours disagree: half a patch (`terms.places.patches`). So many may be beside their print.
MANY = SIZE // 2

#: Where images show a surface at the end of a search, nothing is sampled if this share of its distances agrees as well.
DISTANCES = 0.95

#: Weight of a new frame in the running mean of the outlier share.
MEMORY = 0.03

#: So many tries of CMA-ES in a row that find nothing better than the descent begin the backoff; its most frames.
PATIENCE, MAX_PAUSE = 4, 7


@dataclass(frozen=True)
class Settings:
    """TOML keys of the search.

    Attributes:
        steps: maximum number of steps of the descent per frame.
        tolerance: the descent ends with a step if the decrease per parameter predicted for it, or for the next one, is
            less than this [nats]. The noise of a frame moves the estimate by ½, but in all directions alike; what is
            left here may lie in a single one, along the surface, where ½ in all is a standard deviation.
        population: candidates per generation of CMA-ES; 0: 4 + 3 ln dim, its default.
        generations: maximum number of generations per frame of CMA-ES.
        step: initial standard deviation of its candidates, in deviations of the priors.
        fallback_above: CMA-ES starts when the outlier share after the descent exceeds its running mean by this.
        fallback_until: CMA-ES continues in the next frames until that excess is below this.
        restarts: maximum number of times that the population doubles in the first two frames.
    """

    steps: Annotated[int, Ge(1)] = 12
    tolerance: Annotated[float, Gt(0)] = 0.01
    population: Annotated[int, Ge(0)] = 0
    generations: Annotated[int, Ge(1)] = 25
    step: Annotated[float, Gt(0)] = 1.0
    fallback_above: Annotated[float, Interval(gt=0, lt=1)] = 0.03
    fallback_until: Annotated[float, Interval(gt=0, lt=1)] = 0.015
    restarts: Annotated[int, Ge(0)] = 3

    def build(self, dimension: int, generator: np.random.Generator) -> "Hybrid":
        """A search in `dimension` dimensions that draws from `generator`."""
        make = partial(CmaEsSampler, dimension, generator, MIN_STEP * self.step)
        return Hybrid(self, make, self.population or default_population(dimension))


class Hybrid:
    """An `Optimizer`: descent first, sampling as a fallback."""

    def __init__(self, settings: Settings, make: MakeSampler, population: int):
        self._settings = settings
        self._make = make
        self._population = population
        self._sampler = make(population, settings.step)
        self._schedule = Schedule("cma_es", settings.generations, SIGNIFICANT)
        self._mean_outliers = 1.0
        self._in_fallback = False
        self._backoff = Backoff(settings.fallback_above)

    def follow(self, problem: FrameProblem, start: NDArray[np.float64], budget: Budget) -> Search:
        """Descends; with too many outliers, begins anew where images show the surface, or samples the priors."""
        found = (yield from self._descend(problem, start, budget)).compared(problem)
        limit = self._settings.fallback_until if self._in_fallback else self._settings.fallback_above
        share = outlier_share(found.fits)
        if share <= self._mean_outliers + limit:
            self._backoff = Backoff(self._settings.fallback_above)
        elif self._backoff.take_attempt(share):
            beside = disagreeing_colors(found.fits) >= MANY and not budget.exhausted()
            place = problem.shown_at(found.theta) if beside else None
            if place is not None and place is not found.theta:
                return replace(found, theta=place, linearized=None, fits=(), is_start=True)
            tried = found
            if place is None or distances_share(found.fits) < DISTANCES:
                tried = (yield from self._fall_back(problem, start, found, budget)).compared(problem)
            self._backoff.tried(tried.cost < found.cost, share)
            found = tried
        self._update_mean(outlier_share(found.fits))
        return found

    def explore(self, problem: FrameProblem, start: NDArray[np.float64], budget: Budget) -> Search:
        """Descends, then samples the priors with growing populations."""
        restarts = self._settings.restarts
        search = explore(problem, start, self._descend, self._make, self._population, restarts, budget)
        found = (yield from search).compared(problem)
        self._mean_outliers = outlier_share(found.fits)
        return found

    def _descend(self, problem: FrameProblem, start: NDArray[np.float64], budget: Budget) -> Search:
        tolerance = self._settings.tolerance * problem.dimension
        return descend(problem, start, self._settings.steps, tolerance, budget)

    def _fall_back(
        self, problem: FrameProblem, start: NDArray[np.float64], descended: Outcome, budget: Budget
    ) -> Search:
        """The better of the descent and of CMA-ES followed by a descent."""
        if not self._in_fallback:
            self._sampler = self._make(self._population, self._settings.step)
        metric = search_metric(problem.prior(start))
        sampled = yield from sample(start, np.inf, metric, self._sampler, self._schedule, budget)
        polished = yield from self._descend(problem, sampled.theta, budget)
        if polished.cost < descended.cost - SIGNIFICANT:
            return replace(sampled, theta=polished.theta, cost=polished.cost, linearized=polished.linearized)
        return replace(descended, linearized=polished.linearized)

    def _update_mean(self, outliers: float) -> None:
        """Updates the running mean; a higher share that lasts becomes the mean, which ends a fallback in vain."""
        self._in_fallback = outliers > self._mean_outliers + self._settings.fallback_until
        self._mean_outliers += MEMORY * (outliers - self._mean_outliers)


class Backoff:
    """Exponential backoff: frames without CMA-ES after it has found nothing better `PATIENCE` times: 1, 3, `MAX_PAUSE`.

    Something may hide measurements for seconds, such as a hand that takes hold of the object: the descent explains all
    others, and samples cost several times as much as it does.

    Args:
        surprise: an outlier share that is larger by this than at the last try ends a pause.
    """

    def __init__(self, surprise: float):
        self._surprise = surprise
        self._in_vain, self._left, self._share = 0, 0, 0.0

    def take_attempt(self, share: float) -> bool:
        """True if CMA-ES is to be tried in a frame with this outlier share; else a frame of the pause has passed."""
        if self._left and share <= self._share + self._surprise:
            self._left -= 1
            return False
        return True

    def tried(self, is_better: bool, share: float) -> None:
        """CMA-ES was tried in a frame with this outlier share after the descent."""
        self._in_vain = 0 if is_better else self._in_vain + 1
        length = 2 ** (self._in_vain - PATIENCE + 1) - 1 if self._in_vain >= PATIENCE else 0
        self._left, self._share = min(length, MAX_PAUSE), share
