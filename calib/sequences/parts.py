"""Components of an error: temporal noise, fixed-pattern noise, and offset common to all pixels."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.noise.base import DepthNoise, pixels_where
from calib.sequences.reference import Kind, Reference
from calib.sequences.static import Static

#: Variance of a normal distribution trimmed by one per cent at either end, relative to the full one.
_LEFT = 0.8735


@dataclass(frozen=True, slots=True)
class Parts:
    """Error components of a sequence, or of pixels at similar distances; all in metres.

    Attributes:
        pixels: number of pixels.
        distance: mean true distance.
        amplitude: mean; NaN without.
        temporal: deviation from frame to frame, root mean square over the pixels.
        fixed: deviation of the pixels' means from the common offset, corrected for temporal noise and quantisation; NaN
            if the means themselves are the reference.
        offset: mean offset from the true distance; NaN if unknown.
        step: quantisation step of the distances.
    """

    pixels: int
    distance: float
    amplitude: float
    temporal: float
    fixed: float
    offset: float
    step: float


def separate(static: Static, reference: Reference, model: DepthNoise, where: NDArray[np.bool_]) -> Parts:
    """Error components of one sequence.

    Args:
        static: the sequence.
        reference: its true distances.
        model: noise model; determines the common mean offset.
        where: mask of pixels (height, width).
    """
    pixels = where & np.isfinite(reference.distance)
    x, a = reference.distance[pixels], static.brightness[pixels]
    variance, count = static.variance[pixels], static.count[pixels]
    off = static.mean[pixels] - x
    step = static.steps.at(x)
    fixed = np.nan
    if reference.kind is not Kind.MEAN:
        rest = off - model.mean(x, a, pixels_where(pixels))
        known = float(np.mean(variance / count) + np.mean(_of_steps(variance, step)))
        fixed = np.sqrt(max(_trimmed_variance(rest) - known, 0.0))
    return Parts(
        int(pixels.sum()),
        float(np.mean(x)),
        float(np.mean(a)),
        float(np.sqrt(np.mean(variance))),
        float(fixed),
        float(np.median(off)) if reference.kind.tells_offset else np.nan,
        float(np.mean(step)),
    )


def pattern(
    statics: Sequence[Static], references: Sequence[Reference], model: DepthNoise
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fixed error of each pixel over all sequences, and its deviation, (height, width) [m].

    Sequences are weighted by their information on a pixel's mean; NaN without any.
    """
    shape = statics[0].mean.shape
    total, weight = np.zeros(shape), np.zeros(shape)
    for static, reference in zip(statics, references):
        pixels = np.isfinite(reference.distance) & (static.count > 0)
        x, a = reference.distance[pixels], static.brightness[pixels]
        off = static.mean[pixels] - x - model.mean(x, a, pixels_where(pixels))
        precision = 1 / (static.variance[pixels] / static.count[pixels] + np.square(static.steps.at(x)) / 12 + 1e-12)
        total[pixels] += precision * (off - np.median(off))
        weight[pixels] += precision
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(weight > 0, total / weight, np.nan), np.where(weight > 0, 1 / np.sqrt(weight), np.nan)


def _of_steps(variance: NDArray[np.float64], step: NDArray[np.float64]) -> NDArray[np.float64]:
    """Variance that quantisation leaves in a mean; decreases as noise dithers the values.

    Of a uniform error of a step Δ, noise of deviation σ leaves Δ²/(2π²) exp(−4π² σ²/Δ²), the first term of its Fourier
    series (Widrow and Kollár, Quantization Noise, 2008).
    """
    square = np.square(np.maximum(step, 1e-12))
    return square / (2 * np.pi**2) * np.exp(-4 * np.pi**2 * variance / square)


def _trimmed_variance(values: NDArray[np.float64]) -> float:
    """Variance of a normal distribution, from values trimmed by one per cent at either end."""
    low, high = np.quantile(values, [0.01, 0.99])
    return float(np.var(values[(values >= low) & (values <= high)])) / _LEFT
