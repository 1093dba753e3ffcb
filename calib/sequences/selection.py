"""Noise model selection by held-out likelihood."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial

import numpy as np

from calib.noise.base import DepthNoise, NoiseError, Pixels
from calib.noise.fit.quality import Quality, goodness_of_fit
from calib.sequences.candidates import Candidate
from calib.sequences.evidence import Evidence, thinned, together

#: Number of folds of the cross-validation.
FOLDS = 3

#: Negligible gain of log-likelihood per measurement: the cost of σ wrong by 1.7 %, or μ by 0.025 σ. Sampling changes
#: less, as long as trials draw the same samples.
NOTHING = 0.0003

#: Number of single measurements for fitting and for scoring during model selection.
ENOUGH = 20_000

#: Number of single measurements for the final fit.
THOROUGH = 150_000

_NO_QUALITY = Quality(*([np.nan] * len(fields(Quality))))


@dataclass(frozen=True, slots=True)
class Trial:
    """Result of a candidate.

    Attributes:
        candidate: the candidate.
        scores: log-likelihood per measurement of every held-out part; empty if the fit failed.
        quality: mean goodness of fit on held-out parts.
        failure: error message of the fit; "" on success.
    """

    candidate: Candidate
    scores: tuple[float, ...]
    quality: Quality
    failure: str = ""

    @property
    def score(self) -> float:
        """Held-out log-likelihood per measurement; −∞ if the fit failed."""
        return float(np.mean(self.scores)) if self.scores else -np.inf

    def behind(self, other: "Trial") -> tuple[float, float]:
        """Difference of held-out log-likelihood to another trial, and its standard deviation."""
        difference = np.subtract(other.scores, self.scores)
        deviation = np.std(difference, ddof=1) / np.sqrt(len(difference)) if len(difference) > 1 else 0.0
        return float(np.mean(difference)), float(deviation)


def alike_from(generator: np.random.Generator) -> Callable[[], np.random.Generator]:
    """Factory of generators with the same state, so that all candidates are compared on the same samples."""
    return partial(np.random.default_rng, int(generator.integers(2**32)))


def attempt(candidate: Candidate, parts: Sequence[Evidence], generator: np.random.Generator) -> Trial:
    """Cross-validates a candidate.

    Args:
        candidate: model to fit.
        parts: evidence of every sequence, or of every third of the frames if there are few sequences. Parts are never
            divided, because measurements of one pixel in one sequence are correlated.
        generator: subsamples measurements; must have the same state for trials that are compared.
    """
    scores, qualities = [], []
    try:
        for known, held_out in _folds(parts):
            model = candidate.fit(lean(together(known), generator))
            for part in held_out:
                qualities.append(goodness_of_fit(model, thinned(part.samples, ENOUGH, generator)))
                scores.append(qualities[-1].log_likelihood)
        if not np.isfinite(scores).all():
            raise NoiseError("the likelihood of what was held out is not finite")
    except NoiseError as error:
        return Trial(candidate, (), _NO_QUALITY, str(error))
    values = [[getattr(one, field.name) for one in qualities] for field in fields(Quality)]
    return Trial(candidate, tuple(scores), Quality(*(float(np.mean(value)) for value in values)))


def choose(trials: Sequence[Trial]) -> Trial:
    """Simplest trial, by number of coefficients, that no other exceeds by more than a negligible gain.

    Held-out likelihood already penalises superfluous coefficients. The scatter of the difference between sequences is
    no measure of significance here, because a coefficient may matter in a few sequences only.

    Raises:
        NoiseError: all fits failed.
    """
    fitted = [trial for trial in trials if trial.scores]
    if not fitted:
        raise NoiseError("no noise model can be fitted: " + "; ".join(sorted({trial.failure for trial in trials})))
    best = max(fitted, key=lambda trial: trial.score)
    for trial in fitted:
        if trial.behind(best)[0] <= NOTHING:
            return trial
    return best


def lean(evidence: Evidence, generator: np.random.Generator, maximum: int = ENOUGH) -> Evidence:
    """Evidence with subsampled single measurements and all means."""
    return replace(evidence, samples=thinned(evidence.samples, maximum, generator))


def extremes(model: DepthNoise, distances: tuple[float, float], amplitudes: tuple[float, float]) -> tuple[float, ...]:
    """Smallest and largest σ, and largest |μ| [m], over ranges of distances [m] and amplitudes.

    A model of a fixed image size is evaluated on a grid over the image.
    """
    x, a = np.meshgrid(np.geomspace(*distances, 25), np.linspace(*amplitudes, 25))
    grid = _grid(model)
    x, a = (np.repeat(part.ravel(), grid[0].size) for part in (x, a))
    rows, columns = (np.tile(part, 625) for part in grid)
    sigma, mu = model.deviation(x, a, (rows, columns)), model.mean(x, a, (rows, columns))
    return float(sigma.min()), float(sigma.max()), float(np.abs(mu).max())


def typical_sigma(model: DepthNoise, distance: float, amplitude: float) -> float:
    """Median σ of the pixels [m] at a distance [m] and an amplitude."""
    pixels = _grid(model)
    x, a = (np.full(pixels[0].size, value) for value in (distance, amplitude))
    return float(np.median(model.deviation(x, a, pixels)))


def _grid(model: DepthNoise) -> Pixels:
    """Rows and columns of 64 pixels all over the image, or one if all are alike."""
    height, width = getattr(model, "shape", (1, 1))
    rows, columns = np.meshgrid(*(np.unique(np.linspace(0, n - 1, 8).astype(int)) for n in (height, width)))
    return rows.ravel(), columns.ravel()


def _folds(parts: Sequence[Evidence]) -> Iterator[tuple[list[Evidence], list[Evidence]]]:
    """Pairs of training and held-out parts."""
    n = min(FOLDS, len(parts))
    for fold in range(n):
        yield [p for i, p in enumerate(parts) if i % n != fold], [p for i, p in enumerate(parts) if i % n == fold]
