"""Noise of an amplitude, intensity or infra-red image around what the vertex's reflectivity makes of the light."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import ArrayLike, NDArray

from calib.noise.fit import fitting, pictures

#: Streams of one number per pixel that tell of reflectivity.
Stream = Literal["amplitude", "intensity", "ir"]


@dataclass(frozen=True)
class GaussianIntensity:
    """A constant deviation and one in proportion to the measured value, which grow together as variances.

    The constant part is the sensor's noise; the proportional one is what sparse synthesis leaves out (a texture is read
    between two pixels, a light flickers), and that is more where it is brighter. The tracker takes both at the measured
    value, which it knows before it searches, and not at the one that it compares it with: their densities differ by a
    factor of 1 + relative² in sum, and by their skewness.

    Attributes:
        stream: of the sensor's streams, the one that is meant.
        sigma: constant part of the standard deviation, in units of the stream.
        relative: proportional part of the standard deviation.
        illumination: `active` if the sensor brings its own light, so that a surface is fainter the farther away it is
            and the more it is inclined; `passive` if the light is the room's, so that it looks the same everywhere.
        full_scale: largest value of the stream; a value that says nothing about the surface is uniform up to it.
    """

    stream: Stream
    sigma: Annotated[float, Gt(0)]
    relative: Annotated[float, Ge(0)] = 0.1
    illumination: Literal["active", "passive"] = "active"
    full_scale: Annotated[float, Gt(0)] = 65535.0

    @property
    def uniform(self) -> float:
        """Negative log-density of a value that says nothing about the surface."""
        return float(np.log(self.full_scale))

    def deviation(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Standard deviation of measured values, in their shape."""
        return np.sqrt(np.float32(self.sigma**2) + (np.float32(self.relative) * values) ** 2)

    def build(self) -> "GaussianIntensity":
        """The model itself: its TOML keys are its fields."""
        return self


Settings = GaussianIntensity


def fit(measured: ArrayLike, real: ArrayLike, stream: Stream, full_scale: float = 65535.0) -> GaussianIntensity:
    """The model of greatest likelihood; its illumination is the usual one, `active`.

    Args:
        measured: numbers of pixels, in units of the stream; NaN where they do not count.
        real: what they would have measured without noise, in the same shape; dark and bright ones.
        stream: of the sensor's streams, the one that is meant.
        full_scale: largest value of the stream.

    Raises:
        NoiseError: no measured number comes with a real one, or all are equally bright.
    """
    residual, brightness = pictures.residuals(measured, real)
    spread = np.column_stack([np.ones(len(residual)), brightness**2])
    none = spread[:, :0]
    law = fitting.maximize(residual, fitting.Columns(none, spread), power=2, span=full_scale).spread
    if law[1] < 0:  # brighter pixels err less: nothing that this model could say
        law = fitting.maximize(residual, fitting.Columns(none, spread[:, :1]), power=2, span=full_scale).spread
    least = 1e-6 * float(np.mean(brightness**2)) * float(law[1:].sum())  # variance is never 0, not even in the dark
    sigma = np.sqrt(max(float(law[0]), least))
    return GaussianIntensity(stream, float(sigma), float(np.sqrt(law[1:].sum())), full_scale=full_scale)
