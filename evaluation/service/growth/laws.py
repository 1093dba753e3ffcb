"""Laws of growth, fitted to measured times."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Law:
    """time = start + each · numberᵖ, the form of which is chosen before anything is measured.

    Attributes:
        power: p.
        start: time without any, in the unit of the times that it was fitted to, mostly ms.
        each: time of each, in the same unit.
        determination: R², share of the variance of the times that the law explains.
    """

    power: float
    start: float
    each: float
    determination: float

    def time(self, number: float) -> float:
        """Time for a number."""
        return self.start + self.each * number**self.power

    def wall(self, time: float) -> float:
        """Number at which a time is reached; infinite if none costs anything."""
        if self.each <= 0:
            return float("inf")
        return (max(time - self.start, 0.0) / self.each) ** (1 / self.power)

    def in_words(self) -> str:
        """The law of times in milliseconds as a formula."""
        number = "n" if self.power == 1 else f"n^{self.power:g}"
        return f"{self.start:.3g} ms + {self.each:.3g} ms · {number}"


def fit(numbers: Sequence[float], times: Sequence[float], power: float = 1.0) -> Law:
    """The law with least squares of the differences, for times of numbers; at least three of each.

    It is NaN if one of the times is.
    """
    if not np.all(np.isfinite(times)):
        return Law(power, np.nan, np.nan, np.nan)
    x, y = np.asarray(numbers, float) ** power, np.asarray(times, float)
    each, start = np.polyfit(x, y, 1)
    left = np.sum((y - start - each * x) ** 2) / np.sum((y - y.mean()) ** 2)
    return Law(power, float(start), float(each), float(1 - left))
