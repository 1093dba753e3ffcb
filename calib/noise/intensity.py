"""Noise of an amplitude, intensity or infra-red image around what the vertex's reflectivity makes of the light."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

#: Streams of one number per pixel that tell of reflectivity.
Stream = Literal["amplitude", "intensity", "ir"]


@dataclass(frozen=True)
class GaussianIntensity:
    """A constant deviation and one in proportion to the measured value, which grow together as variances.

    The constant part is the sensor's noise; the proportional one is what sparse synthesis leaves out (a texture is read
    between two pixels, a light flickers), and that is more where it is brighter.

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
