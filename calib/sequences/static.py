"""Static sequence: mean and variance of each pixel while nothing moves."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.noise.base import NoiseError
from calib.noise.fit.samples import Samples, from_images
from calib.sequences import stillness
from calib.sequences.steps import Steps, recognize
from calib.sequences.stillness import Segment

#: A segment whose mean differs by more than this many deviations shows another surface.
_ELSEWHERE = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Static:
    """Statistics of one sequence; images are (height, width).

    Attributes:
        name: of the sequence, for display.
        frames: number of frames.
        distance, amplitude: some of the frames (k, height, width) [m]; NaN where a pixel was not static.
        mean: mean distance of each pixel [m]; NaN if never static.
        variance: variance of its distances [m²].
        count: number of distances used.
        returns: number of frames with a return.
        brightness: mean amplitude of each pixel; NaN without.
        rays: unit directions (height, width, 3).
        steps: quantisation of the distances.
        moving: fraction of the pixels with returns that moved at some time.
    """

    name: str
    frames: int
    distance: NDArray[np.float32]
    amplitude: NDArray[np.float32]
    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    count: NDArray[np.int64]
    returns: NDArray[np.int64]
    brightness: NDArray[np.float64]
    rays: NDArray[np.float64]
    steps: Steps
    moving: float

    @property
    def still(self) -> NDArray[np.bool_]:
        """Pixels that were static during at least one segment."""
        return np.isfinite(self.mean)

    @property
    def common(self) -> float:
        """Deviation of all pixels together from frame to frame, over that of a pixel alone [1]."""
        off = (self.distance - self.mean).reshape(len(self.distance), -1)
        frames = np.nanmean(off[np.isfinite(off).any(axis=1)], axis=1)
        return float(np.std(frames) / math.sqrt(np.mean(self.variance[self.still]) or math.inf))

    def samples(self, reference: NDArray[np.floating], kept: slice = slice(None)) -> Samples:
        """Measurements of some kept frames, with true distances (height, width) [m]; NaN where unknown."""
        samples = from_images(self.distance[kept], reference, self.amplitude[kept], self.steps.at(self.mean))
        return samples.take(np.isfinite(samples.measured) & np.isfinite(samples.true))


def reduce(
    name: str,
    lengths: NDArray[np.floating],
    amplitude: NDArray[np.floating],
    rays: NDArray[np.floating],
    along: NDArray[np.floating],
    digit: float,
    keep: int,
) -> Static:
    """Statistics of the static pixels of a sequence.

    Args:
        name: of the sequence, for display.
        lengths: raw measurements (n, height, width) [m]; NaN without return.
        amplitude: likewise; NaN without.
        rays: unit directions (height, width, 3).
        along: radial distance per unit of `lengths` (height, width).
        digit: resolution of the sensor's numbers [m]; 0 if they are not integers.
        keep: number of frames kept as samples, evenly spread; at least 2.

    Raises:
        NoiseError: too few frames, or no static pixel.
    """
    slices = stillness.segments(len(lengths))
    steps = recognize(lengths, digit)
    step = steps.at(np.nan_to_num(lengths[len(lengths) // 2]))
    distance = (lengths * along).astype(np.float32)
    found = [stillness.look(distance[part], amplitude[part], step) for part in slices]
    still = _agreeing(found)
    if not still.any():
        raise NoiseError(f"{name}: nothing in it is static")
    counts = np.array([part.count for part in found]) * still
    total = np.where(counts.sum(axis=0), counts.sum(axis=0), np.nan)
    mean, brightness = (np.where(still, [getattr(part, field) for part in found], 0) for field in ("mean", "amplitude"))
    freedom = np.where(still, counts - 1, 0).sum(axis=0).clip(1)
    variance = (np.where(still, [part.variance for part in found], 0) * (counts - 1).clip(0)).sum(axis=0) / freedom
    kept = np.unique(np.linspace(0, len(lengths) - 1, max(2, min(keep, len(lengths)))).astype(int))
    shown = np.repeat(still, [part.stop - part.start for part in slices], axis=0)[kept]
    seen = np.any([np.isfinite(part.mean) for part in found], axis=0)
    moving = np.any([part.moving for part in found], axis=0)
    return Static(
        name,
        len(lengths),
        np.where(shown, distance[kept], np.nan).astype(np.float32),
        np.where(shown, amplitude[kept], np.nan).astype(np.float32),
        (mean * counts).sum(axis=0) / total,
        variance,
        counts.sum(axis=0),
        np.isfinite(distance).sum(axis=0),
        (brightness * counts).sum(axis=0) / total,
        np.asarray(rays, np.float64),
        steps,
        float(moving.sum() / seen.sum()),
    )


def _agreeing(found: list[Segment]) -> NDArray[np.bool_]:
    """Mask (n, height, width) of static segments that show each pixel the same surface."""
    still = np.array([part.still for part in found])
    means = np.where(still, [part.mean for part in found], np.nan)
    median = stillness.median(means)
    deviation = np.sqrt(stillness.median(np.where(still, [part.variance for part in found], np.nan)))
    with np.errstate(invalid="ignore"):
        off = np.abs(means - median) - np.maximum(_ELSEWHERE * deviation, 1e-4)
    return still & ((off <= 0) | (len(found) == 1))
