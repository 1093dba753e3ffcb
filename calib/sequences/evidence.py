"""Evidence of a sequence: single measurements, and per-pixel means."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.noise.base import NoiseError
from calib.noise.fit.samples import Samples, joined
from calib.noise.fit.shrinkage import Repeats
from calib.sequences.reference import Reference
from calib.sequences.static import Static

#: Outlier threshold in deviations of the pixel.
_CUT = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Measurements and means of the same frames.

    Attributes:
        samples: single measurements, including outliers.
        means: mean distance and amplitude of every pixel with returns, without outliers.
        repeats: replicates of the means.
    """

    samples: Samples
    means: Samples
    repeats: Repeats


def gather(static: Static, reference: Reference, kept: slice = slice(None)) -> Evidence:
    """Evidence of some of the frames kept in a sequence.

    Raises:
        NoiseError: no measurement of a known distance.
    """
    samples = static.samples(reference.distance, kept)
    if not len(samples):
        raise NoiseError(f"{static.name}: no static pixel has a known distance")
    limit = np.maximum(_CUT * np.sqrt(static.variance[samples.pixels]), samples.step)
    near = np.abs(samples.measured - static.mean[samples.pixels]) <= limit
    return Evidence(samples, *_averaged(samples.take(near), static.mean.shape))


def together(parts: Sequence[Evidence]) -> Evidence:
    """Concatenated evidence."""
    times, variance = (np.concatenate([getattr(part.repeats, name) for part in parts]) for name in Repeats._fields)
    samples, means = (joined([getattr(part, name) for part in parts]) for name in ("samples", "means"))
    return Evidence(samples, means, Repeats(times, variance))


def thinned(samples: Samples, maximum: int, generator: np.random.Generator) -> Samples:
    """Samples, at most `maximum` of them, drawn at random."""
    return samples if len(samples) <= maximum else samples.take(generator.choice(len(samples), maximum, replace=False))


def _averaged(samples: Samples, shape: tuple[int, ...]) -> tuple[Samples, Repeats]:
    """Means of the samples of each pixel, all of one true distance."""
    place = samples.row * shape[1] + samples.column
    n = np.bincount(place, minlength=shape[0] * shape[1])

    def mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.bincount(place, values, len(n)) / n.clip(1)

    measured = mean(samples.measured)
    variance = mean(np.square(samples.measured - measured[place]))
    some = np.nonzero(n)[0]
    true, amplitude, step = (mean(values) for values in (samples.true, samples.amplitude, samples.step))
    means = Samples(measured[some], true[some], amplitude[some], some // shape[1], some % shape[1], step[some])
    return means, Repeats(n[some].astype(np.float64), variance[some])
