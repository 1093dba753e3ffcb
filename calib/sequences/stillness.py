"""Which parts of a sequence are static: where what changes is no more than noise."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from calib.noise.base import NoiseError
from calib.noise.fit.fitting import MAD_TO_SIGMA

#: Frames that are judged together, and the fewest that anything can be said of.
SEGMENT, LEAST_FRAMES = 30, 8

#: Share of a segment's frames in which a static pixel has a return, and share of these that are no outlier.
_RETURNS, _INLIERS = 0.8, 0.9

#: Deviation of a normal distribution over the median size of the difference between two of its values.
_PER_CHANGE = MAD_TO_SIGMA / np.sqrt(2)

#: Deviations beyond which a value is an outlier of its pixel.
_CUT = 4.0

#: Variance over the one that successive differences tell, at which a pixel moves: six standard deviations of this ratio
#: (von Neumann, 1941) for n frames are about 6/√n.
_RATIO = 6.0

#: Neighbours whose distances differ by more than this share of it lie on different surfaces, at a rim.
_RIM = 0.03

#: A pixel whose deviation is so many times that of the pixels around it flickers between two surfaces; how many around.
_FLICKER, _NEIGHBOURHOOD = 3.0, 7

#: Pixels around a moving one that do not count either.
_AROUND = 2


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """What each pixel did during some frames; arrays are (height, width).

    Attributes:
        mean: of the distances without outliers [m]; NaN where there was never a return.
        variance: of the distances around their mean [m²].
        still: where nothing moved.
        moving: where something did; what is neither has too few returns, lies at a rim or flickers.
        count: distances that are no outlier.
        amplitude: mean amplitude; NaN without.
    """

    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    still: NDArray[np.bool_]
    moving: NDArray[np.bool_]
    count: NDArray[np.int64]
    amplitude: NDArray[np.float64]


def segments(n: int) -> list[slice]:
    """Frames that are judged together: about `SEGMENT` each, none left over.

    Raises:
        NoiseError: too few frames.
    """
    if n < LEAST_FRAMES:
        raise NoiseError(f"{n} frames are too few to tell noise from motion; record at least {LEAST_FRAMES}")
    edges = np.linspace(0, n, max(1, round(n / SEGMENT)) + 1).astype(int)
    return [slice(first, last) for first, last in pairwise(edges)]


def look(distance: NDArray[np.floating], amplitude: NDArray[np.floating], step: NDArray[np.floating]) -> Segment:
    """Judges one segment.

    Successive differences tell the noise even of what moves slowly; what moves varies by more than they tell. A sensor
    that smooths over time has larger variance than they tell everywhere, which is taken from the quieter quarter of
    all pixels. Jumps by one step are no motion.

    Args:
        distance: (n, height, width) [m]; NaN without return.
        amplitude: likewise; NaN without.
        step: of the distances (height, width) [m].
    """
    centre = median(distance)
    usual_change = median(np.abs(np.diff(distance, axis=0)))  # outliers do not make it larger
    kept = _near(distance, centre, np.square(_PER_CHANGE * usual_change), step)
    fast = _fast(np.where(kept, distance, np.nan))
    kept = _near(distance, centre, fast, step)
    mean, variance, count = _moments(distance, kept)
    seen = np.isfinite(distance).sum(axis=0)
    enough = seen >= _RETURNS * len(distance)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(variance > step**2, variance / fast, 1.0)
    usual = max(1.0, float(np.quantile(ratio[enough], 0.25))) if enough.any() else 1.0
    steady = np.less(ratio, usual * (1 + _RATIO / np.sqrt(len(distance))))
    changes = enough & (np.logical_not(steady) | (count < _INLIERS * seen))
    moving = ndimage.binary_opening(changes, np.ones((2, 2))) | (changes & (variance > (2 * step) ** 2))
    near_moving = np.asarray(ndimage.binary_dilation(moving, iterations=_AROUND), np.bool_)
    still = enough & ~near_moving & ~changes & ~_rims(centre, fast)
    still &= ~_flickers(np.sqrt(variance), enough, step)
    return Segment(mean, variance, still, moving, count, _moments(amplitude, kept & np.isfinite(amplitude))[0])


def median(values: NDArray[np.floating]) -> NDArray[np.float64]:
    """Median (height, width) over the frames without NaN; NaN where all are. NumPy's is many times slower."""
    ordered = np.sort(values, axis=0)
    middle = (np.isfinite(ordered).sum(axis=0) - 1).clip(0) // 2
    return np.take_along_axis(ordered, middle[None], axis=0)[0].astype(np.float64)


def _near(
    distance: NDArray[np.floating],
    centre: NDArray[np.float64],
    variance: NDArray[np.float64],
    step: NDArray[np.floating],
) -> NDArray[np.bool_]:
    """Which distances (n, height, width) are no outliers."""
    with np.errstate(invalid="ignore"):
        return np.abs(distance - centre) <= np.maximum(_CUT * np.sqrt(variance), 1.5 * step)


def _fast(distance: NDArray[np.floating]) -> NDArray[np.float64]:
    """Variance (height, width) that successive differences tell [m²]."""
    squares = np.square(np.diff(distance, axis=0))
    known = np.isfinite(squares)
    return np.where(known, squares, 0).sum(axis=0, dtype=np.float64) / (2 * known.sum(axis=0).clip(1))


def _moments(
    values: NDArray[np.floating], kept: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Mean, variance and number (height, width) of the values that are kept; NaN without any."""
    count = kept.sum(axis=0)
    with np.errstate(invalid="ignore"):
        mean = np.where(kept, values, 0).sum(axis=0, dtype=np.float64) / np.where(count, count, np.nan)
        squares = np.square(np.where(kept, values - mean, 0)).sum(axis=0, dtype=np.float64)
    return mean, squares / (count - 1).clip(1), count


def _rims(centre: NDArray[np.float64], variance: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Where a pixel and one of its neighbours see different surfaces, or the neighbour sees none."""
    far = ndimage.maximum_filter(np.nan_to_num(centre, nan=np.inf), 3)
    near = ndimage.minimum_filter(np.nan_to_num(centre, nan=-np.inf), 3)
    with np.errstate(invalid="ignore"):
        return ~(far - near <= np.maximum(_RIM * centre, _CUT * np.sqrt(variance)))


def _flickers(deviation: NDArray[np.float64], seen: NDArray[np.bool_], step: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Where a pixel deviates by far more than those around it, which a dark surface does not."""
    usual = float(np.median(deviation[seen])) if seen.any() else 0.0
    around = ndimage.median_filter(np.where(seen, deviation, usual), _NEIGHBOURHOOD)
    return deviation > _FLICKER * np.maximum(around, np.nan_to_num(step) / 2)
