"""Quantisation of distances: resolution of a sensor's numbers, and disparity steps, which grow as x²."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

#: Smaller differences are floating-point rounding [m].
_NOTHING_M = 2e-6

#: Number of distance bins, and minimum number of pixels in each.
_BINS, _FEW = 12, 30

#: Minimum ratio of a disparity step to the resolution.
_DIGITS = 3

#: Largest relative variation of the growth between distances for disparity steps.
_ALIKE = 0.35


@dataclass(frozen=True, slots=True)
class Steps:
    """Quantisation step at distance x: the larger of `digit` and `growth` · x².

    Attributes:
        digit: resolution at any distance [m]; 0 if there is none.
        growth: step per squared distance [1/m]; 0 if steps are constant.
    """

    digit: float = 0.0
    growth: float = 0.0

    def at(self, x: NDArray[np.floating]) -> NDArray[np.float64]:
        """Steps [m] at distances [m], in their shape."""
        return np.maximum(self.digit, self.growth * np.square(np.asarray(x, np.float64)))


def recognize(lengths: NDArray[np.floating], digit: float) -> Steps:
    """Quantisation of a sequence, from the smallest gap between the values of each pixel.

    Integer disparities give steps ∝ x², rounded to the resolution. The smallest gap is the one rounded downwards, so
    half a unit of the resolution is added.

    Args:
        lengths: raw measurements (n, height, width) [m], z or radial; NaN without return.
        digit: resolution of the sensor's numbers [m]; 0 if they are not integers.
    """
    x, step = _gaps(lengths)
    if len(x) < _FEW:
        return Steps(digit)
    edges = np.geomspace(x.min(), x.max() * (1 + 1e-6), _BINS + 1)
    bins = [inside for low, high in pairwise(edges) if (inside := (x >= low) & (x < high)).sum() >= _FEW]
    if not bins:
        return Steps(digit)
    # Some pixels never take two adjacent values, so the lower quartile is used.
    typical = np.array([np.quantile(step[inside], 0.25) for inside in bins])
    growth = np.array([(t + digit / 2) / np.median(x[inside]) ** 2 for t, inside in zip(typical, bins)])
    growth = growth[typical > (_DIGITS - 0.5) * max(digit, _NOTHING_M)]
    alike = len(growth) > 0 and np.all(np.abs(growth / np.median(growth) - 1) < _ALIKE)
    return Steps(digit, float(np.median(growth)) if alike else 0.0)


def _gaps(lengths: NDArray[np.floating]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Median value and smallest gap (pixels,) [m] of the pixels with more than one value."""
    ordered = np.sort(lengths, axis=0)  # NaN last
    gap = np.diff(ordered, axis=0)
    smallest = np.where(gap > _NOTHING_M, gap, np.inf).min(axis=0, initial=np.inf)
    usual = ordered[(np.isfinite(ordered).sum(axis=0) // 2).clip(max=len(ordered) - 1), *np.indices(smallest.shape)]
    seen = np.isfinite(smallest) & (usual > 0)
    return usual[seen].astype(np.float64), smallest[seen].astype(np.float64)
