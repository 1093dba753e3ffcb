"""Differences of two methods on the same sequences."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.stats import t


def upper_end(first: Sequence[float], second: Sequence[float]) -> float:
    """Upper end of the 95 % interval of the mean of first − second; NaN for fewer than two sequences."""
    differences = np.subtract(first, second)
    count = len(differences)
    if count < 2:
        return math.nan
    half_width = t.ppf(0.975, count - 1) * differences.std(ddof=1) / math.sqrt(count)
    return float(differences.mean() + half_width)
