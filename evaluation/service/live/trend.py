"""Linear trend of correlated measurements."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d
from scipy.stats import t

#: Neighbouring measurements are averaged into this many before the line is fitted. Memory grows in steps, so
#: single measurements are correlated, and a line through them would have too small a variance.
BLOCKS = 12


@dataclass(frozen=True, slots=True)
class Trend:
    """Slope of a linear trend.

    Attributes:
        slope: of the straight line, per unit of time.
        half_width: of the slope's interval of 95 % confidence.
    """

    slope: float
    half_width: float


def rolling_minimum(values: NDArray[np.floating], samples: int) -> NDArray[np.floating]:
    """Minimum filter over `samples` neighbouring values (n,): lower envelope of a saw-tooth of that period."""
    return np.asarray(minimum_filter1d(values, min(samples, len(values)), mode="nearest"))


def trend(times: NDArray[np.floating], values: NDArray[np.floating]) -> Trend:
    """Least-squares line through block means of values (n,) at times (n,), n at least `BLOCKS`."""
    blocks = np.array_split(np.stack([times, values]), BLOCKS, axis=1)
    means = np.array([block.mean(axis=1) for block in blocks], np.float64).T
    (slope, _), covariance = np.polyfit(means[0], means[1], 1, cov=True)
    return Trend(float(slope), float(t.ppf(0.975, BLOCKS - 2) * np.sqrt(covariance[0, 0])))
