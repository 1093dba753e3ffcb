"""Structured light and stereo: random error and quantisation that grow with the square of the distance."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from calib.noise.base import Pixels
from calib.noise.fit import fitting
from calib.noise.fit.samples import Samples


@dataclass(frozen=True)
class StructuredLight:
    """σ²(x) = (noise x²)² + (step x²)² / 12 + floor², no mean offset.

    A disparity error of constant size is an error ∝ x² in distance (Khoshelham and Elberink, Sensors 2012: 1.425e-3 / m
    for a Kinect v1). The disparity is quantised, so distances come in steps ∝ x² as well, about two deviations
    wide; a uniform error of that width adds its variance step² / 12. Distances are taken along the ray; for
    a sensor that measures z the difference to z is below 10 % of σ within 25° of the optical axis.

    Attributes:
        noise: deviation of the random part per squared distance [1/m].
        step: quantisation step per squared distance [1/m].
        floor: deviation at any distance [m]: fine relief of the surface that the mesh cannot represent.
    """

    noise: Annotated[float, Gt(0)] = 1.425e-3
    step: Annotated[float, Ge(0)] = 2.85e-3
    floor: Annotated[float, Ge(0)] = 0.0

    @property
    def uses_amplitude(self) -> bool:
        """Structured light has no amplitude."""
        return False

    def build(self) -> "StructuredLight":
        """The model itself: its TOML keys are its fields."""
        return self

    def mean(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """No mean offset [m]."""
        return np.zeros_like(x)

    def deviation(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Standard deviation σ(x) [m]."""
        square = x * x  # a general power of an array costs ten times as much
        return np.sqrt((self.noise**2 + self.step**2 / 12) * (square * square) + self.floor**2)


Settings = StructuredLight


def fit(samples: Samples, step: float) -> StructuredLight:
    """The model of greatest likelihood.

    Residuals tell the sum of random error and quantisation, not how much of it is which; so the step has to be known:
    from the data sheet, or from the distances themselves, whose inverses are multiples of it.

    Args:
        samples: measurements.
        step: quantisation step per squared distance [1/m].

    Raises:
        NoiseError: no sample has a distance.
    """
    samples = fitting.thinned(samples.returns(with_amplitude=False))
    spread = np.column_stack([samples.true**4, np.ones(len(samples))])
    law = fitting.maximize(samples.residual, fitting.Columns(spread[:, :0], spread), power=2)
    if law.spread[1] <= 0:  # no floor, or one that is hidden by the rest
        law = fitting.maximize(samples.residual, fitting.Columns(spread[:, :0], spread[:, :1]), power=2)
    random = max(float(law.spread[0]) - step**2 / 12, (1e-3 * step) ** 2, 1e-12)
    return StructuredLight(float(np.sqrt(random)), step, float(np.sqrt(law.spread[1:].sum())))
