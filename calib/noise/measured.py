"""Deviation that the sensor itself reports for every measurement, in an image beside its distances."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray

from calib.noise.base import Pixels
from calib.noise.fit import fitting
from calib.noise.fit.samples import Samples

#: Upper bound of a reported deviation [m]; beyond any sensor's range.
MAX_M = 100.0


@dataclass(frozen=True)
class Measured:
    """σ² = (factor a)² + floor², where a [m] is the sensor's own σ of this measurement; no mean offset.

    A sensor's own σ includes shot noise and ambient light per pixel and frame, which no function of distance and
    amplitude does. It excludes detail finer than the mesh and the correlation of errors between pixels; `floor` adds to
    σ and `factor` scales it to account for both.

    Attributes:
        factor: scale of the sensor's own deviation.
        floor: deviation of a measurement with reported σ of 0 [m]: detail finer than the mesh, uncalibrated systematic
            errors.
    """

    factor: Annotated[float, Gt(0)] = 1.0
    floor: Annotated[float, Gt(0)] = 1e-4

    @property
    def uses_amplitude(self) -> bool:
        """Always true: the sensor's own deviation takes the place of the amplitude and is required for every pixel."""
        return True

    def build(self) -> "Measured":
        """The model itself: its TOML keys are its fields."""
        return self

    def mean(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Zero mean offset [m]."""
        return np.zeros_like(x)

    def deviation(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Standard deviation σ(a) [m]."""
        own = self.factor * np.clip(a, 0, MAX_M)
        return np.broadcast_to(np.sqrt(own * own + self.floor**2), np.shape(x)).copy()


Settings = Measured


def fit(samples: Samples) -> Measured:
    """Maximum-likelihood model.

    Args:
        samples: measurements, with the sensor's own deviations [m] as amplitudes.

    Raises:
        NoiseError: no sample has a distance and a deviation, or all have the same deviation.
    """
    samples = fitting.subsampled(samples.returns(with_amplitude=True))
    spread = np.column_stack([samples.amplitude**2, np.ones(len(samples))])
    law = fitting.maximize_likelihood(samples.residual, fitting.Design(spread[:, :0], spread), power=2)
    scaled, floor = np.sqrt(np.maximum(law.spread, 0))
    return Measured(max(float(scaled), 1e-3), max(float(floor), 1e-6))
