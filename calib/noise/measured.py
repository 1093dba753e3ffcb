"""The deviation that the sensor itself tells for every measurement, in an image beside its distances."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray

from calib.noise.base import Pixels
from calib.noise.fit import fitting
from calib.noise.fit.samples import Samples

#: A deviation beyond any sensor's range says no more than this [m], for which single precision has room.
LARGEST_M = 100.0


@dataclass(frozen=True)
class Measured:
    """σ² = (factor a)² + floor², where a [m] is the sensor's own σ of this measurement; no mean offset.

    Sensors know of shot noise and ambient light, pixel by pixel and frame by frame, what no law of distance and
    amplitude does. They do not know what the mesh leaves out, nor how their errors hang together from pixel to
    pixel; so `floor` adds to σ, and `factor` scales it.

    Attributes:
        factor: on the sensor's own deviation.
        floor: deviation of a measurement that the sensor takes for exact [m]: relief finer than the mesh, systematic
            errors that nobody calibrated.
    """

    factor: Annotated[float, Gt(0)] = 1.0
    floor: Annotated[float, Gt(0)] = 1e-4

    @property
    def uses_amplitude(self) -> bool:
        """The sensor's own deviation takes the place of the amplitude; without one, a pixel cannot be judged."""
        return True

    def build(self) -> "Measured":
        """The model itself: its TOML keys are its fields."""
        return self

    def mean(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """No mean offset [m]."""
        return np.zeros_like(x)

    def deviation(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Standard deviation σ(a) [m]."""
        own = self.factor * np.clip(a, 0, LARGEST_M)
        return np.broadcast_to(np.sqrt(own * own + self.floor**2), np.shape(x)).copy()


Settings = Measured


def fit(samples: Samples) -> Measured:
    """The model of greatest likelihood.

    Args:
        samples: measurements, with the sensor's own deviations [m] in the place of amplitudes.

    Raises:
        NoiseError: no sample has a distance and a deviation, or all have the same deviation.
    """
    samples = fitting.thinned(samples.returns(with_amplitude=True))
    spread = np.column_stack([samples.amplitude**2, np.ones(len(samples))])
    law = fitting.maximize(samples.residual, fitting.Columns(spread[:, :0], spread), power=2)
    scaled, floor = np.sqrt(np.maximum(law.spread, 0))
    return Measured(max(float(scaled), 1e-3), max(float(floor), 1e-6))
