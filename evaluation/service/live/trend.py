"""Whether something grows: a straight line through measurements that are not independent of each other."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d
from scipy.stats import t

#: Neighbouring measurements are averaged into this many before the line is fitted. Memory grows in steps and stays,
#: so that single measurements err together and a line through them would look much surer than it is.
BLOCKS = 12


@dataclass(frozen=True, slots=True)
class Trend:
    """How fast something grows.

    Attributes:
        slope: of the straight line, per unit of time.
        half_width: of the slope's interval of 95 % confidence.
    """

    slope: float
    half_width: float


def least_within(values: NDArray[np.floating], samples: int) -> NDArray[np.floating]:
    """The least of so many neighbouring values (n,): what a saw-tooth of that period, or less, stands on."""
    return np.asarray(minimum_filter1d(values, min(samples, len(values)), mode="nearest"))


def trend(times: NDArray[np.floating], values: NDArray[np.floating]) -> Trend:
    """The straight line through values (n,) at times (n,), n at least `BLOCKS`, by least squares of block means."""
    blocks = np.array_split(np.stack([times, values]), BLOCKS, axis=1)
    means = np.array([block.mean(axis=1) for block in blocks], np.float64).T
    (slope, _), covariance = np.polyfit(means[0], means[1], 1, cov=True)
    return Trend(float(slope), float(t.ppf(0.975, BLOCKS - 2) * np.sqrt(covariance[0, 0])))
