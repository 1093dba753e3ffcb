"""The 95 % regions of covariances, and whether the truth lies inside."""

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

#: Probability of a region.
SHARE = 0.95


def inside_region(error: NDArray[np.float64], covariance: NDArray[np.float64]) -> NDArray[np.bool_]:
    """True (n,) where errors (n, d) lie inside the 95 % ellipsoids of covariances (n, d, d)."""
    square = np.einsum("ni,ni->n", error, np.linalg.solve(covariance, error[..., None])[..., 0])
    return square < chi2.ppf(SHARE, error.shape[1])
