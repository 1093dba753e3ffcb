"""Measurements of known distances, from which noise models are fitted and judged."""

from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.noise.base import NoiseError, Pixels
from calib.noise.fit.polynomial import Span

#: Share of the samples at either end of a quantity that does not count for its domain: outliers are there.
_TAIL = 0.002


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Measurements of one sensor, one per entry, in any order.

    Attributes:
        measured: measured radial distance (n,) [m]; NaN, infinity or less than zero for no return.
        true: real radial distance (n,) [m].
        amplitude: measured amplitude (n,); NaN where there is none.
        row, column: pixel that measured (n,).
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
        """Measured minus real distance (n,) [m]."""
        return self.measured - self.true

    @property
    def pixels(self) -> Pixels:
        """Rows and columns (n,)."""
        return self.row, self.column

    def take(self, which: NDArray[np.integer] | NDArray[np.bool_]) -> "Samples":
        """The samples that an index or a mask (n,) selects."""
        return Samples(*(getattr(self, field.name)[which] for field in fields(self)))

    def returns(self, with_amplitude: bool) -> "Samples":
        """The samples with a finite, positive measured and real distance and, if asked for, amplitude.

        Raises:
            NoiseError: there is none.
        """
        with np.errstate(invalid="ignore"):
            good = (self.measured > 0) & (self.true > 0) & np.isfinite(self.measured) & np.isfinite(self.true)
            good &= (self.amplitude > 0) & np.isfinite(self.amplitude) if with_amplitude else True
        if not good.any():
            raise NoiseError(f"none of {len(self)} samples has a distance" + " and an amplitude" * with_amplitude)
        return self.take(good)


def joined(parts: Iterable[Samples]) -> Samples:
    """All samples of several parts, in their order."""
    columns = zip(*([getattr(part, field.name) for field in fields(Samples)] for part in parts))
    return Samples(*map(np.concatenate, columns))


def from_images(measured: ArrayLike, true: ArrayLike, amplitude: ArrayLike) -> Samples:
    """The samples of one depth image, or of several.

    Args:
        measured: radial distances (…, height, width) [m].
        true: real distances, of the same shape or one that repeats to it, such as (height, width).
        amplitude: likewise; NaN if the sensor has none.
    """
    distance = np.asarray(measured, np.float64)
    real, brightness = (np.broadcast_to(np.asarray(image, np.float64), distance.shape) for image in (true, amplitude))
    row, column = (np.broadcast_to(index, distance.shape) for index in np.indices(distance.shape[-2:]))
    return Samples(distance.ravel(), real.ravel(), brightness.ravel(), row.ravel(), column.ravel())


def domain(values: NDArray[np.float64]) -> Span:
    """Lowest and highest of some values without the outermost ones; where all are equal, a thousandth around them."""
    low, high = (float(value) for value in np.quantile(values, [_TAIL, 1 - _TAIL]))
    return (low, high) if low < high else (low * 0.999, low * 1.001)
