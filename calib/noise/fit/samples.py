"""Measurements of known distances: input for fitting and evaluating noise models."""

from collections.abc import Iterable
from dataclasses import dataclass, field, fields

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
        step: quantisation step of the measured distance (n,) [m]; zeros if left out.
    """

    measured: NDArray[np.float64]
    true: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    row: NDArray[np.int64]
    column: NDArray[np.int64]
    step: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        if not self.step.size:
            object.__setattr__(self, "step", np.zeros(self.measured.shape))
        shapes = {one.name: getattr(self, one.name).shape for one in fields(self)}
        if len(set(shapes.values())) != 1 or self.measured.ndim != 1:
            raise NoiseError(f"samples must be arrays (n,) of one length, not {shapes}")

    def __len__(self) -> int:
        return len(self.measured)

    @property
    def residual(self) -> NDArray[np.float64]:
        """Measured minus true distance (n,) [m]."""
        return self.measured - self.true

    @property
    def minimum_sigma(self) -> NDArray[np.float64]:
        """Deviation (n,) [m] that quantisation alone makes; a bit less, as residuals of few steps are not uniform."""
        return 0.9 * self.step / np.sqrt(12)

    @property
    def pixels(self) -> Pixels:
        """Rows and columns (n,)."""
        return self.row, self.column

    def take(self, which: NDArray[np.integer] | NDArray[np.bool_]) -> "Samples":
        """Samples selected by an index or a mask (n,)."""
        return Samples(*(getattr(self, one.name)[which] for one in fields(self)))

    def returns(self, with_amplitude: bool) -> "Samples":
        """Samples with finite, positive measured and true distance and, if asked for, amplitude; raises as `where`."""
        return self.take(self.where(with_amplitude))

    def where(self, with_amplitude: bool) -> NDArray[np.bool_]:
        """Mask (n,) of these samples.

        Raises:
            NoiseError: there are none.
        """
        with np.errstate(invalid="ignore"):
            good = (self.measured > 0) & (self.true > 0) & np.isfinite(self.measured) & np.isfinite(self.true)
            good &= (self.amplitude > 0) & np.isfinite(self.amplitude) if with_amplitude else True
        if not good.any():
            raise NoiseError(f"none of {len(self)} samples has a distance" + " and an amplitude" * with_amplitude)
        return good


def joined(parts: Iterable[Samples]) -> Samples:
    """Concatenation of several sets of samples."""
    columns = zip(*([getattr(part, one.name) for one in fields(Samples)] for part in parts))
    return Samples(*map(np.concatenate, columns))


def from_images(measured: ArrayLike, true: ArrayLike, amplitude: ArrayLike, step: ArrayLike = 0.0) -> Samples:
    """Samples of one depth image, or of several.

    Args:
        measured: radial distances (…, height, width) [m].
        true: true distances, of the same or a broadcastable shape, such as (height, width).
        amplitude: likewise; NaN if the sensor has none.
        step: quantisation steps [m], likewise.
    """
    distance = np.asarray(measured, np.float64)
    images = (np.asarray(image, np.float64) for image in (true, amplitude, step))
    real, brightness, steps = (np.broadcast_to(image, distance.shape).ravel() for image in images)
    row, column = (np.broadcast_to(index, distance.shape) for index in np.indices(distance.shape[-2:]))
    return Samples(distance.ravel(), real, brightness, row.ravel(), column.ravel(), steps)


def domain(values: NDArray[np.float64]) -> Span:
    """Range of values without the extreme quantiles; ± 0.1 % if all are equal."""
    low, high = (float(value) for value in np.quantile(values, [_TAIL, 1 - _TAIL]))
    return (low, high) if low < high else (low * 0.999, low * 1.001)
