"""Statistics that several experiments share: differences of two methods, and the regions of covariances."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, t

#: Probability of a region.
SHARE = 0.95


def inside_region(error: NDArray[np.float64], covariance: NDArray[np.float64]) -> NDArray[np.bool_]:
    """True (n,) where errors (n, d) lie inside the 95 % ellipsoids of covariances (n, d, d)."""
    square = np.einsum("ni,ni->n", error, np.linalg.solve(covariance, error[..., None])[..., 0])
    return square < chi2.ppf(SHARE, error.shape[1])


def upper_end(first: Sequence[float], second: Sequence[float]) -> float:
    """Upper end of the 95 % interval of the mean of first − second; NaN for fewer than two sequences."""
    differences = np.subtract(first, second)
    count = len(differences)
    if count < 2:
        return math.nan
    half_width = t.ppf(0.975, count - 1) * differences.std(ddof=1) / math.sqrt(count)
    return float(differences.mean() + half_width)
