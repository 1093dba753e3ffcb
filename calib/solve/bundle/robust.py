"""Robust statistics: influence function, scale of a group, inflation of the covariance."""

import numpy as np
from numpy.typing import NDArray

#: Scale of the soft-L1 loss in deviations; 98 % efficient for normal errors.
SOFT_L1_SCALE = 2.0

#: Residuals beyond this many deviations are outliers.
OUTLIER = 4.0

#: Clipping point of Huber's proposal 2, and the variance of clipped standard normal errors.
_CLIP = 2.0
_LEFT = 0.920537


def influence(residuals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Influence ψ: derivative of the soft-L1 loss ρ = 2 c² (√(1 + r²/c²) - 1)."""
    return residuals / np.sqrt(1 + (residuals / SOFT_L1_SCALE) ** 2)


def covariance_inflation(residuals: NDArray[np.float64]) -> float:
    """κ = E[ψ²] / E[ψ′]²: variance of the estimate relative to least squares with unit deviations (Huber, 1981)."""
    return float(np.mean(influence(residuals) ** 2)) / efficiency(residuals) ** 2


def efficiency(residuals: NDArray[np.float64]) -> float:
    """E[ψ′]: mean curvature of the robust loss relative to least squares."""
    return float(np.mean((1 + (residuals / SOFT_L1_SCALE) ** 2) ** -1.5))


def scale(residuals: NDArray[np.float64], redundancy: float) -> float:
    """Robust standard deviation of residuals: Huber's proposal 2 (Robust Statistics, section 6.7).

    Args:
        residuals: (n,).
        redundancy: n minus the number of parameters that these residuals determine.
    """
    deviation = 1.4826 * float(np.median(np.abs(residuals)))
    for _ in range(30):
        if deviation == 0.0:
            return 0.0
        clipped = np.minimum((residuals / deviation) ** 2, _CLIP**2)
        deviation *= float(np.sqrt(clipped.sum() / (redundancy * _LEFT)))
    return deviation
