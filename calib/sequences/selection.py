"""Which noise model a sensor's measurements call for, by the likelihood of what it was not fitted to."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial

import numpy as np

from calib.noise.base import DepthNoise, NoiseError
from calib.noise.fit.quality import Quality, goodness_of_fit
from calib.sequences.candidates import Candidate
from calib.sequences.evidence import Evidence, thinned, together

#: Parts that are held out in turn, each once.
FOLDS = 3

#: A gain of log-likelihood per measurement below this is none in practice: σ wrong by 1.7 %, or μ by 0.025 σ, cost as
#: much. What was drawn changes less, as long as trials are drawn alike.
NOTHING = 0.0003

#: Single measurements that a law of the image is fitted to while models are compared, and that each part is judged by.
ENOUGH = 20_000

#: Single measurements that the law of the chosen model is fitted to.
THOROUGH = 150_000

_NO_QUALITY = Quality(*([np.nan] * len(fields(Quality))))


@dataclass(frozen=True, slots=True)
class Trial:
    """How a candidate did.

    Attributes:
        candidate: what was tried.
        scores: log-likelihood per measurement of every part that was held out; empty if it could not be fitted.
        quality: agreement with everything held out, on average.
        failure: why it could not be fitted; "" if it could.
    """

    candidate: Candidate
    scores: tuple[float, ...]
    quality: Quality
    failure: str = ""

    @property
    def score(self) -> float:
        """Log-likelihood per measurement that was held out; −∞ if there is none."""
        return float(np.mean(self.scores)) if self.scores else -np.inf

    def behind(self, other: "Trial") -> tuple[float, float]:
        """How much less likely it makes what was held out than another trial does, and the deviation of that."""
        difference = np.subtract(other.scores, self.scores)
        deviation = np.std(difference, ddof=1) / np.sqrt(len(difference)) if len(difference) > 1 else 0.0
        return float(np.mean(difference)), float(deviation)


def alike_from(generator: np.random.Generator) -> Callable[[], np.random.Generator]:
    """Makes generators that draw the same measurements, so that what was drawn makes no difference between models."""
    return partial(np.random.default_rng, int(generator.integers(2**32)))


def attempt(candidate: Candidate, parts: Sequence[Evidence], generator: np.random.Generator) -> Trial:
    """Fits a candidate to all parts but some, judges it by these, and so on until each part was held out once.

    Args:
        candidate: what to try.
        parts: what every sequence says, or every third of the frames if there are few sequences. Parts are never
            divided: measurements of one pixel in one sequence have more in common than the model says.
        generator: thins measurements where there are more than needed; of trials that are compared, in the same state.
    """
    scores, qualities = [], []
    try:
        for known, held_out in _folds(parts):
            model = candidate.fit(lean(together(known), generator))
            for part in held_out:
                qualities.append(goodness_of_fit(model, thinned(part.samples, ENOUGH, generator)))
                scores.append(qualities[-1].log_likelihood)
    except NoiseError as error:
        return Trial(candidate, (), _NO_QUALITY, str(error))
    values = [[getattr(one, field.name) for one in qualities] for field in fields(Quality)]
    return Trial(candidate, tuple(scores), Quality(*(float(np.mean(value)) for value in values)))


def choose(trials: Sequence[Trial]) -> Trial:
    """The first of the trials, which are in the order of their coefficients, that no other is clearly better than.

    What is held out punishes coefficients that are not needed, so a gain of more than nothing is one. The deviation of
    the difference between sequences is no measure here: what a coefficient tells may concern a few of them only.

    Raises:
        NoiseError: nothing could be fitted.
    """
    fitted = [trial for trial in trials if trial.scores]
    if not fitted:
        raise NoiseError("no noise model can be fitted: " + "; ".join(sorted({trial.failure for trial in trials})))
    best = max(fitted, key=lambda trial: trial.score)
    for trial in fitted:
        if trial.behind(best)[0] <= NOTHING:
            return trial
    return best


def lean(evidence: Evidence, generator: np.random.Generator, most: int = ENOUGH) -> Evidence:
    """Evidence with no more single measurements than a law of the image needs, and all means."""
    return replace(evidence, samples=thinned(evidence.samples, most, generator))


def extremes(model: DepthNoise, distances: tuple[float, float], amplitudes: tuple[float, float]) -> tuple[float, ...]:
    """Least and greatest σ, and greatest |μ| [m], over ranges of distances [m] and amplitudes.

    A model that is for images of one size is looked at in a grid over the image.
    """
    x, a = np.meshgrid(np.geomspace(*distances, 25), np.linspace(*amplitudes, 25))
    height, width = getattr(model, "shape", (1, 1))
    grid = np.meshgrid(*(np.unique(np.linspace(0, n - 1, 8).astype(int)) for n in (height, width)))
    x, a = (np.repeat(part.ravel(), grid[0].size) for part in (x, a))
    rows, columns = (np.tile(part.ravel(), 625) for part in grid)
    sigma, mu = model.deviation(x, a, (rows, columns)), model.mean(x, a, (rows, columns))
    return float(sigma.min()), float(sigma.max()), float(np.abs(mu).max())


def _folds(parts: Sequence[Evidence]) -> Iterator[tuple[list[Evidence], list[Evidence]]]:
    """What to fit to and what to judge by."""
    n = min(FOLDS, len(parts))
    for fold in range(n):
        yield [p for i, p in enumerate(parts) if i % n != fold], [p for i, p in enumerate(parts) if i % n == fold]
