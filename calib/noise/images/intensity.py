"""Noise of an amplitude, intensity or infra-red image around the value predicted from the vertex's reflectivity."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import ArrayLike, NDArray

from calib.noise.fit import fitting, image_noise

#: Single-channel streams that depend on reflectivity.
Stream = Literal["amplitude", "intensity", "ir"]


@dataclass(frozen=True)
class GaussianIntensity:
    """Sum of a constant variance and one proportional to the squared measured value.

    The constant part is sensor noise; the proportional part covers errors of sparse synthesis (interpolation between
    pixels, flicker), which grow with brightness. The tracker evaluates both at the measured value, which is known
    before the search, instead of the synthesised one; the densities differ by a factor of 1 + relative² in total, and
    in skewness.

    Attributes:
        stream: stream of the sensor that is compared.
        sigma: constant part of the standard deviation, in units of the stream.
        relative: proportional part of the standard deviation, relative to the measured value.
        illumination: `active` for the sensor's own light, whose return falls with distance and angle of incidence;
            `passive` for ambient light, under which a surface looks the same from everywhere.
        full_scale: largest value of the stream, in its units; outliers are uniform up to it.
    """

    stream: Stream
    sigma: Annotated[float, Gt(0)]
    relative: Annotated[float, Ge(0)] = 0.1
    illumination: Literal["active", "passive"] = "active"
    full_scale: Annotated[float, Gt(0)] = 65535.0

    @property
    def uniform(self) -> float:
        """Negative log-density of an outlier: uniform up to full scale."""
        return float(np.log(self.full_scale))

    def deviation(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Standard deviation of measured values, in their shape."""
        return np.sqrt(np.float32(self.sigma**2) + (np.float32(self.relative) * values) ** 2)

    def build(self) -> "GaussianIntensity":
        """The model itself: its TOML keys are its fields."""
        return self


Settings = GaussianIntensity


def fit(measured: ArrayLike, real: ArrayLike, stream: Stream, full_scale: float = 65535.0) -> GaussianIntensity:
    """Maximum-likelihood model with the default illumination, `active`.

    Args:
        measured: pixel values, in units of the stream; NaN is ignored.
        real: noise-free values, in the same shape; dark and bright ones.
        stream: stream of the sensor.
        full_scale: largest value of the stream.

    Raises:
        NoiseError: no measured value has a finite true value, or all have the same brightness.
    """
    residual, brightness = image_noise.residuals(measured, real)
    spread = np.column_stack([np.ones(len(residual)), brightness**2])
    none = spread[:, :0]
    law = fitting.maximize_likelihood(residual, fitting.Design(none, spread), power=2, span=full_scale).spread
    if law[1] < 0:  # errors that decrease with brightness contradict the model; use the constant part only
        law = fitting.maximize_likelihood(
            residual, fitting.Design(none, spread[:, :1]), power=2, span=full_scale
        ).spread
    minimum = 1e-6 * float(np.mean(brightness**2)) * float(law[1:].sum())  # variance is never 0, not even in the dark
    sigma = np.sqrt(max(float(law[0]), minimum))
    return GaussianIntensity(stream, float(sigma), float(np.sqrt(law[1:].sum())), full_scale=full_scale)
