"""Measurements of known distances: input for fitting and evaluating noise models."""

from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.noise.base import NoiseError, Pixels
from calib.noise.fit.polynomial import Span

#: Fraction of samples at either end of a quantity that is excluded from its domain as possible outliers.
_TAIL = 0.002


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Measurements of one sensor, one per entry, in any order.

    Attributes:
        measured: measured radial distance (n,) [m]; NaN, infinite or negative without return.
        true: true radial distance (n,) [m].
        amplitude: measured amplitude (n,); NaN if there is none.
        row, column: measuring pixel (n,).
    """

    measured: NDArray[np.float64]
    true: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    row: NDArray[np.int64]
    column: NDArray[np.int64]

    def __post_init__(self) -> None:
        shapes = {field.name: getattr(self, field.name).shape for field in fields(self)}
        if len(set(shapes.values())) != 1 or self.measured.ndim != 1:
            raise NoiseError(f"samples must be arrays (n,) of one length, not {shapes}")

    def __len__(self) -> int:
        return len(self.measured)

    @property
    def residual(self) -> NDArray[np.float64]:
        """Measured minus true distance (n,) [m]."""
        return self.measured - self.true

    @property
    def pixels(self) -> Pixels:
        """Rows and columns (n,)."""
        return self.row, self.column

    def take(self, which: NDArray[np.integer] | NDArray[np.bool_]) -> "Samples":
        """Samples selected by an index or a mask (n,)."""
        return Samples(*(getattr(self, field.name)[which] for field in fields(self)))

    def returns(self, with_amplitude: bool) -> "Samples":
        """Samples with finite, positive measured and true distance and, if asked for, amplitude.

        Raises:
            NoiseError: there are none.
        """
        with np.errstate(invalid="ignore"):
            good = (self.measured > 0) & (self.true > 0) & np.isfinite(self.measured) & np.isfinite(self.true)
            good &= (self.amplitude > 0) & np.isfinite(self.amplitude) if with_amplitude else True
        if not good.any():
            raise NoiseError(f"none of {len(self)} samples has a distance" + " and an amplitude" * with_amplitude)
        return self.take(good)


def joined(parts: Iterable[Samples]) -> Samples:
    """Concatenation of several sets of samples."""
    columns = zip(*([getattr(part, field.name) for field in fields(Samples)] for part in parts))
    return Samples(*map(np.concatenate, columns))


def from_images(measured: ArrayLike, true: ArrayLike, amplitude: ArrayLike) -> Samples:
    """Samples of one depth image, or of several.

    Args:
        measured: radial distances (…, height, width) [m].
        true: true distances, of the same or a broadcastable shape, such as (height, width).
        amplitude: likewise; NaN if the sensor has none.
    """
    distance = np.asarray(measured, np.float64)
    real, brightness = (np.broadcast_to(np.asarray(image, np.float64), distance.shape) for image in (true, amplitude))
    row, column = (np.broadcast_to(index, distance.shape) for index in np.indices(distance.shape[-2:]))
    return Samples(distance.ravel(), real.ravel(), brightness.ravel(), row.ravel(), column.ravel())


def domain(values: NDArray[np.float64]) -> Span:
    """Range of values without the extreme quantiles; ± 0.1 % if all are equal."""
    low, high = (float(value) for value in np.quantile(values, [_TAIL, 1 - _TAIL]))
    return (low, high) if low < high else (low * 0.999, low * 1.001)
