"""The steps that distances come in: those of a sensor's digits, and those of its disparity, which grow as x²."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

#: A difference below this is rounding of the computer, not of the sensor [m].
_NOTHING_M = 2e-6

#: Bins of distance in which the pixels' steps are looked at, and how many of them a bin needs.
_BINS, _FEW = 12, 30

#: A step that is at least as many digits is one of the disparity, if it grows as one.
_DIGITS = 3

#: How far growth may differ between distances, relative to its median, if it is that of a disparity.
_ALIKE = 0.35


@dataclass(frozen=True, slots=True)
class Steps:
    """Step of a distance x: the larger of `digit` and `growth` · x².

    Attributes:
        digit: smallest step at any distance [m]; 0 if there is none.
        growth: step per squared distance [1/m]; 0 if steps do not grow.
    """

    digit: float = 0.0
    growth: float = 0.0

    def at(self, x: NDArray[np.floating]) -> NDArray[np.float64]:
        """Steps [m] at distances [m], in their shape."""
        return np.maximum(self.digit, self.growth * np.square(np.asarray(x, np.float64)))


def recognize(lengths: NDArray[np.floating], digit: float) -> Steps:
    """The steps of a sequence, from the smallest gap between the values that each pixel takes.

    A disparity of whole numbers makes steps ∝ x², which are then rounded to digits: downwards as often as upwards, but
    the smallest gap is the one rounded downwards, so half a digit is added to it.

    Args:
        lengths: what the sensor delivers (n, height, width) [m], z or radial; NaN without return.
        digit: smallest difference that the sensor's numbers can have [m]; 0 if they are no whole numbers.
    """
    x, step = _gaps(lengths)
    if len(x) < _FEW:
        return Steps(digit)
    edges = np.geomspace(x.min(), x.max() * (1 + 1e-6), _BINS + 1)
    bins = [inside for low, high in pairwise(edges) if (inside := (x >= low) & (x < high)).sum() >= _FEW]
    if not bins:
        return Steps(digit)
    # Some pixels never take two neighbouring values, so the lower quartile counts.
    typical = np.array([np.quantile(step[inside], 0.25) for inside in bins])
    growth = np.array([(t + digit / 2) / np.median(x[inside]) ** 2 for t, inside in zip(typical, bins)])
    growth = growth[typical > (_DIGITS - 0.5) * max(digit, _NOTHING_M)]
    alike = len(growth) > 0 and np.all(np.abs(growth / np.median(growth) - 1) < _ALIKE)
    return Steps(digit, float(np.median(growth)) if alike else 0.0)


def _gaps(lengths: NDArray[np.floating]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Usual value and smallest gap (pixels,) [m] of the pixels that take more than one value."""
    ordered = np.sort(lengths, axis=0)  # NaN last
    gap = np.diff(ordered, axis=0)
    smallest = np.where(gap > _NOTHING_M, gap, np.inf).min(axis=0, initial=np.inf)
    usual = ordered[(np.isfinite(ordered).sum(axis=0) // 2).clip(max=len(ordered) - 1), *np.indices(smallest.shape)]
    seen = np.isfinite(smallest) & (usual > 0)
    return usual[seen].astype(np.float64), smallest[seen].astype(np.float64)
