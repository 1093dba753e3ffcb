"""What a robust loss makes of residuals: scale of a group, and by how much it widens the covariance."""

import numpy as np
from numpy.typing import NDArray

#: Residuals [deviations] up to which the loss is nearly a square; it loses 2 % against least squares on normal errors.
SOFT_L1_SCALE = 2.0

#: Residuals beyond this many deviations count as outliers.
OUTLIER = 4.0

#: Where Huber's second proposal clips, and what it then leaves of the variance of normal errors.
_CLIP = 2.0
_LEFT = 0.920537


def influence(residuals: NDArray[np.float64]) -> NDArray[np.float64]:
    """ψ: derivative of the loss soft_l1, ρ = 2 c² (√(1 + r²/c²) - 1)."""
    return residuals / np.sqrt(1 + (residuals / SOFT_L1_SCALE) ** 2)


def widening(residuals: NDArray[np.float64]) -> float:
    """κ = E[ψ²] / E[ψ′]²: variance of the estimate over that of least squares with unit deviations (Huber, 1981)."""
    bend = (1 + (residuals / SOFT_L1_SCALE) ** 2) ** -1.5
    return float(np.mean(influence(residuals) ** 2) / np.mean(bend) ** 2)


def scale(residuals: NDArray[np.float64], redundancy: float) -> float:
    """Deviation of residuals that may hold outliers: Huber's proposal 2 (Robust Statistics, section 6.7).

    Args:
        residuals: (n,).
        redundancy: n less the share of the parameters that these residuals determined.
    """
    deviation = 1.4826 * float(np.median(np.abs(residuals)))
    for _ in range(30):
        if deviation == 0.0:
            return 0.0
        clipped = np.minimum((residuals / deviation) ** 2, _CLIP**2)
        deviation *= float(np.sqrt(clipped.sum() / (redundancy * _LEFT)))
    return deviation
