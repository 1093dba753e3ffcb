"""Motion detection in a sequence: a pixel is static if it changes no more than by noise."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from calib.noise.base import NoiseError
from calib.noise.fit.fitting import MAD_TO_SIGMA

#: Frames per segment, and minimum number of frames.
SEGMENT, MIN_FRAMES = 30, 8

#: Minimum fraction of frames with a return, and of inliers among these, for a static pixel.
_RETURNS, _INLIERS = 0.8, 0.9

#: σ of a normal distribution over the median absolute difference of two of its values.
_PER_CHANGE = MAD_TO_SIGMA / np.sqrt(2)

#: Outlier threshold in deviations of the pixel.
_CUT = 4.0

#: Threshold for the ratio of the variance to that from successive differences, in standard deviations of this ratio
#: (von Neumann, 1941), which are about 1/√n for n frames.
_RATIO = 6.0

#: Relative difference of neighbouring distances at an edge between surfaces.
_RIM = 0.03

#: Ratio to the deviation of surrounding pixels at which a pixel flickers between two surfaces; size of the window.
_FLICKER, _NEIGHBOURHOOD = 3.0, 7

#: Dilation of moving regions [px].
_AROUND = 2


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """Statistics of each pixel during a segment; arrays are (height, width).

    Attributes:
        mean: of the distances without outliers [m]; NaN where there was never a return.
        variance: of the distances around their mean [m²].
        still: True where nothing moved.
        moving: True where something moved; pixels that are neither have too few returns, lie at an edge or flicker.
        count: number of inliers.
        amplitude: mean amplitude; NaN without.
    """

    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    still: NDArray[np.bool_]
    moving: NDArray[np.bool_]
    count: NDArray[np.int64]
    amplitude: NDArray[np.float64]


def segments(n: int) -> list[slice]:
    """Segments of about `SEGMENT` frames each, covering all frames.

    Raises:
        NoiseError: too few frames.
    """
    if n < MIN_FRAMES:
        raise NoiseError(f"{n} frames are too few to tell noise from motion; record at least {MIN_FRAMES}")
    edges = np.linspace(0, n, max(1, round(n / SEGMENT)) + 1).astype(int)
    return [slice(first, last) for first, last in pairwise(edges)]


def look(distance: NDArray[np.floating], amplitude: NDArray[np.floating], step: NDArray[np.floating]) -> Segment:
    """Statistics and motion of one segment.

    Successive differences estimate the noise even under slow motion; a moving pixel has a larger variance. A sensor
    that smooths over time has a larger variance everywhere, which is estimated from the quieter quarter of all pixels.
    Jumps by one quantisation step are no motion.

    Args:
        distance: (n, height, width) [m]; NaN without return.
        amplitude: likewise; NaN without.
        step: quantisation of the distances (height, width) [m].
    """
    centre = median(distance)
    median_change = median(np.abs(np.diff(distance, axis=0)))  # robust to outliers
    kept = _near(distance, centre, np.square(_PER_CHANGE * median_change), step)
    fast = _fast(np.where(kept, distance, np.nan))
    kept = _near(distance, centre, fast, step)
    mean, variance, count = _moments(distance, kept)
    seen = np.isfinite(distance).sum(axis=0)
    enough = seen >= _RETURNS * len(distance)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(variance > step**2, variance / fast, 1.0)
    baseline = max(1.0, float(np.quantile(ratio[enough], 0.25))) if enough.any() else 1.0
    steady = np.less(ratio, baseline * (1 + _RATIO / np.sqrt(len(distance))))
    changes = enough & (np.logical_not(steady) | (count < _INLIERS * seen))
    moving = ndimage.binary_opening(changes, np.ones((2, 2))) | (changes & (variance > (2 * step) ** 2))
    near_moving = np.asarray(ndimage.binary_dilation(moving, iterations=_AROUND), np.bool_)
    still = enough & ~near_moving & ~changes & ~_rims(centre, fast)
    still &= ~_flickers(np.sqrt(variance), enough, step)
    return Segment(mean, variance, still, moving, count, _moments(amplitude, kept & np.isfinite(amplitude))[0])


def median(values: NDArray[np.floating]) -> NDArray[np.float64]:
    """Median (height, width) over the frames, ignoring NaN; many times faster than NumPy's."""
    ordered = np.sort(values, axis=0)
    middle = (np.isfinite(ordered).sum(axis=0) - 1).clip(0) // 2
    return np.take_along_axis(ordered, middle[None], axis=0)[0].astype(np.float64)


def _near(
    distance: NDArray[np.floating],
    centre: NDArray[np.float64],
    variance: NDArray[np.float64],
    step: NDArray[np.floating],
) -> NDArray[np.bool_]:
    """Mask of inlier distances (n, height, width)."""
    with np.errstate(invalid="ignore"):
        return np.abs(distance - centre) <= np.maximum(_CUT * np.sqrt(variance), 1.5 * step)


def _fast(distance: NDArray[np.floating]) -> NDArray[np.float64]:
    """Variance (height, width) from successive differences [m²]."""
    squares = np.square(np.diff(distance, axis=0))
    known = np.isfinite(squares)
    return np.where(known, squares, 0).sum(axis=0, dtype=np.float64) / (2 * known.sum(axis=0).clip(1))


def _moments(
    values: NDArray[np.floating], kept: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Mean, variance and number (height, width) of the kept values; NaN without any."""
    count = kept.sum(axis=0)
    with np.errstate(invalid="ignore"):
        mean = np.where(kept, values, 0).sum(axis=0, dtype=np.float64) / np.where(count, count, np.nan)
        squares = np.square(np.where(kept, values - mean, 0)).sum(axis=0, dtype=np.float64)
    return mean, squares / (count - 1).clip(1), count


def _rims(centre: NDArray[np.float64], variance: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Pixels with a neighbour on another surface or without a return."""
    far = ndimage.maximum_filter(np.nan_to_num(centre, nan=np.inf), 3)
    near = ndimage.minimum_filter(np.nan_to_num(centre, nan=-np.inf), 3)
    with np.errstate(invalid="ignore"):
        return ~(far - near <= np.maximum(_RIM * centre, _CUT * np.sqrt(variance)))


def _flickers(deviation: NDArray[np.float64], seen: NDArray[np.bool_], step: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Pixels whose deviation is far above that of their surroundings, unlike those of a dark surface."""
    overall = float(np.median(deviation[seen])) if seen.any() else 0.0
    around = ndimage.median_filter(np.where(seen, deviation, overall), _NEIGHBOURHOOD)
    return deviation > _FLICKER * np.maximum(around, np.nan_to_num(step) / 2)
