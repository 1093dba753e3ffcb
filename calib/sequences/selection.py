"""Which noise model a sensor's samples call for, by the likelihood of sequences (or frames) it was not fitted to."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields

import numpy as np

from calib.noise.base import DepthNoise, NoiseError
from calib.noise.quality import Quality, judge
from calib.noise.samples import Samples
from calib.sequences.candidates import Candidate, Level

#: Parts that are held out in turn, each once.
_FOLDS = 3

#: A gain of log-likelihood per sample below this is none in practice: σ wrong by 7 % costs as much.
NOTHING = 0.005

#: Samples of which coefficients for the whole image are fitted while models are compared, and of which each is judged.
_ENOUGH = 40_000


@dataclass(frozen=True, slots=True)
class Trial:
    """How a candidate did.

    Attributes:
        candidate: what was tried.
        scores: log-likelihood per sample of every part that was held out; empty if it could not be fitted.
        quality: agreement with everything held out, on average.
        failure: why it could not be fitted; "" if it could.
    """

    candidate: Candidate
    scores: tuple[float, ...]
    quality: Quality
    failure: str = ""

    @property
    def score(self) -> float:
        """Log-likelihood per sample of what was held out; −∞ if there is none."""
        return float(np.mean(self.scores)) if self.scores else -np.inf

    def behind(self, other: "Trial") -> tuple[float, float]:
        """How much less likely it makes what was held out than another trial does, and that difference's deviation."""
        difference = np.subtract(other.scores, self.scores)
        deviation = np.std(difference, ddof=1) / np.sqrt(len(difference)) if len(difference) > 1 else 0.0
        return float(np.mean(difference)), float(deviation)


def try_all(candidates: Sequence[Candidate], parts: Sequence[Samples], generator: np.random.Generator) -> list[Trial]:
    """Fits and judges every candidate.

    Args:
        candidates: what to try.
        parts: samples of every sequence, or of every frame if there are too few sequences; whole parts are held out.
        generator: thins samples where there are more than needed.
    """
    return [_try(candidate, parts, generator) for candidate in candidates]


def choose(trials: Sequence[Trial]) -> Trial:
    """The first of the trials, which are in the order of their parameters, that no other is clearly better than.

    Clearly better is more than the deviation of the difference (the rule of one standard error), and more than nothing.

    Raises:
        NoiseError: nothing could be fitted.
    """
    fitted = [trial for trial in trials if trial.scores]
    if not fitted:
        raise NoiseError("no noise model fits these samples: " + "; ".join(trial.failure for trial in trials))
    best = max(fitted, key=lambda trial: trial.score)
    for trial in fitted:
        less, deviation = trial.behind(best)
        if less <= max(deviation, NOTHING):
            return trial
    return best


def thinned(samples: Samples, most: int, generator: np.random.Generator) -> Samples:
    """At most so many of the samples, drawn at random."""
    return samples if len(samples) <= most else samples.take(generator.choice(len(samples), most, replace=False))


def together(parts: Sequence[Samples]) -> Samples:
    """All samples of several parts."""
    return Samples(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Samples)))


def _try(candidate: Candidate, parts: Sequence[Samples], generator: np.random.Generator) -> Trial:
    scores, qualities = [], []
    try:
        for known, held_out in _folds(parts):
            model = candidate.fit(_needed(candidate, together(known), generator))
            for part in held_out:
                qualities.append(judge(model, thinned(part, _ENOUGH, generator)))
                scores.append(qualities[-1].log_likelihood)
    except NoiseError as error:
        return Trial(candidate, (), _mean([]), str(error))
    return Trial(candidate, tuple(scores), _mean(qualities))


def _needed(candidate: Candidate, samples: Samples, generator: np.random.Generator) -> Samples:
    """Pixels need all samples there are, the coefficients of an image do not."""
    return thinned(samples, _ENOUGH, generator) if candidate.level is Level.IMAGE else samples


def _folds(parts: Sequence[Samples]) -> Iterator[tuple[list[Samples], list[Samples]]]:
    """What to fit to and what to judge by; every part is held out once."""
    n = min(_FOLDS, len(parts))
    for fold in range(n):
        yield [p for i, p in enumerate(parts) if i % n != fold], [p for i, p in enumerate(parts) if i % n == fold]


def _mean(qualities: Sequence[Quality]) -> Quality:
    values = [[getattr(one, field.name) for one in qualities] or [np.nan] for field in fields(Quality)]
    return Quality(*(float(np.mean(value)) for value in values))


def bounds(model: DepthNoise, far: float, brightest: float) -> tuple[float, float, float]:
    """Least and greatest σ and greatest |μ| [m] of distances up to `far` [m] and amplitudes up to `brightest`.

    Pixels with coefficients of their own are looked at in a grid over the image.
    """
    x, a = np.meshgrid(np.geomspace(0.01, far, 25), np.linspace(0, brightest, 25))
    height, width = getattr(model, "shape", (1, 1))
    rows, columns = np.meshgrid(*(np.unique(np.linspace(0, n - 1, 8).astype(int)) for n in (height, width)))
    x, a = (np.repeat(part.ravel(), rows.size) for part in (x, a))
    p = np.tile(rows.ravel(), 625), np.tile(columns.ravel(), 625)
    sigma, mu = model.deviation(x, a, p), model.mean(x, a, p)
    return float(sigma.min()), float(sigma.max()), float(np.abs(mu).max())
