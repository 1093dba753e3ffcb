"""Quantisation of distances, estimated from the values themselves: a file may count in finer units than its sensor."""

from collections.abc import Iterator
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

#: Minimum ratio of a step to the smallest gap that as many values without steps have by chance.
_CHANCE = 4.0

#: Minimum numbers of values, and of pixels for each of them, that tell steps where no pixel ever changes.
_VALUES, _PIXELS = 4, 8

#: Quartiles of a normal distribution lie this many deviations apart.
_QUARTILES = 1.349


@dataclass(frozen=True, slots=True)
class Steps:
    """Quantisation step at distance x: the largest of `digit`, `growth` · x² and the observed step.

    Attributes:
        digit: resolution at any distance [m]; 0 if there is none.
        growth: step per squared distance [1/m]; 0 if the steps are not those of a disparity.
        observed: distances and steps [m] if the steps follow no law; interpolated in between.
    """

    digit: float = 0.0
    growth: float = 0.0
    observed: tuple[tuple[float, float], ...] = ()

    def at(self, x: NDArray[np.floating]) -> NDArray[np.float64]:
        """Steps [m] at distances [m], in their shape."""
        x = np.asarray(x, np.float64)
        law = np.maximum(self.digit, self.growth * np.square(x))
        if not self.observed:
            return law
        distances, steps = np.array(self.observed).T
        return np.maximum(law, np.interp(x, distances, steps))


def recognize(lengths: NDArray[np.floating], digit: float) -> Steps:
    """Quantisation of a sequence, from the smallest gaps between values.

    Integer disparities give steps ∝ x². They are rounded to a resolution: the unit of the sensor's numbers, or a
    coarser one of an earlier format. The smallest gap is the one rounded downwards, so half the resolution is added.

    Args:
        lengths: raw measurements (n, height, width) [m], z or radial; NaN without return.
        digit: unit of the sensor's numbers [m]; 0 if they are not integers.
    """
    bins = list(_bins(lengths))
    if not bins:
        return Steps(digit)
    x, gap = np.array(bins).T
    gap = np.maximum(gap, digit)
    for resolution in (digit, *np.unique(gap)):
        coarse = gap > (_DIGITS - 0.5) * max(resolution, _NOTHING_M)
        growth = (gap[coarse] + resolution / 2) / x[coarse] ** 2
        common = float(np.median(growth)) if coarse.any() else 0.0
        law = np.maximum(resolution, common * x**2)[~coarse]
        if np.all(np.abs(growth - common) < _ALIKE * common) and np.all(gap[~coarse] > law / _DIGITS):
            return Steps(float(resolution), common)
    return Steps(digit, observed=tuple(zip(x.tolist(), gap.tolist())))


def _bins(lengths: NDArray[np.floating]) -> Iterator[tuple[float, float]]:
    """Middle distance and smallest gap [m] of the bins of distance in which values have gaps."""
    x, gap, chance = _gaps(lengths)
    if len(x) < _FEW:
        return
    for low, high in pairwise(np.geomspace(x.min(), x.max() * (1 + 1e-6), _BINS + 1)):
        inside = (x >= low) & (x < high)
        changing = inside & np.isfinite(gap)
        if changing.sum() >= _FEW:
            # Some pixels never take two adjacent values, so the lower quartile is used.
            typical = float(np.quantile(gap[changing], 0.25))
            if typical > _CHANCE * np.median(chance[changing]):
                yield float(np.median(x[changing])), typical
        elif inside.sum() >= _FEW:
            values = np.unique(x[inside])
            if _VALUES <= len(values) <= inside.sum() / _PIXELS:
                yield float(np.median(x[inside])), float(np.diff(values).min())


def _gaps(lengths: NDArray[np.floating]) -> tuple[NDArray[np.float64], ...]:
    """Median value, smallest gap, ∞ without one, and smallest gap by chance (pixels,) [m] of pixels with returns.

    Of n values of a normal distribution of deviation σ, two are 2 √π σ / (n (n − 1)) apart.
    """
    ordered = np.sort(lengths, axis=0)  # NaN last
    difference = np.diff(ordered, axis=0)
    smallest = np.where(difference > _NOTHING_M, difference, np.inf).min(axis=0, initial=np.inf)
    n = np.isfinite(ordered).sum(axis=0)
    first, median, third = (_at(ordered, n * k // 4) for k in (1, 2, 3))
    with np.errstate(invalid="ignore"):
        seen = median > 0
    pairs = (n * (n - 1)).clip(1)
    chance = 2 * np.sqrt(np.pi) * (third - first) / _QUARTILES / pairs
    return median[seen].astype(np.float64), smallest[seen].astype(np.float64), chance[seen].astype(np.float64)


def _at(ordered: NDArray[np.floating], index: NDArray[np.integer]) -> NDArray[np.floating]:
    """Values (height, width) at an index of each pixel."""
    return np.take_along_axis(ordered, index.clip(max=len(ordered) - 1)[None], axis=0)[0]
