"""Mean and deviation as polynomials in distance and amplitude (eq. 18), one pair for the whole image."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt
from numpy.polynomial.polynomial import polyval, polyval2d
from numpy.typing import NDArray

from calib.noise.base import NoiseError, Pixels

Table = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class GaussianPolynomial:
    """μ(x, a) = Σ mu[i][j] xⁱ aʲ and σ(x, a) = Σ sigma[i][j] xⁱ aʲ, x in metres, a in the sensor's amplitude unit.

    Outside the calibrated domain the polynomials keep their value at its edge, and σ never falls below `least_sigma`,
    so that an extrapolation can neither turn negative nor explode.

    Attributes:
        sigma: coefficients of the deviation [m]; row i belongs to the distance's power i, column j to the amplitude's.
        mu: coefficients of the mean offset [m].
        distances: calibrated range of distances [m].
        amplitudes: calibrated range of amplitudes.
        least_sigma: lower bound of the deviation [m].
    """

    sigma: Table
    mu: Table = ((0.0,),)
    distances: tuple[float, float] = (0.0, 100.0)
    amplitudes: tuple[float, float] = (0.0, 65535.0)
    least_sigma: Annotated[float, Gt(0)] = 1e-4

    def __post_init__(self) -> None:
        for key, table in (("sigma", self.sigma), ("mu", self.mu)):
            if not table or not table[0] or len({len(row) for row in table}) != 1:
                raise NoiseError(f"{key} must be a table of rows of equal length, {key}[i][j] for xⁱ aʲ, not {table}")
        for key, (low, high) in (("distances", self.distances), ("amplitudes", self.amplitudes)):
            if not low < high:
                raise NoiseError(f"{key} must be [lowest, highest] with lowest < highest, not {[low, high]}")

    @property
    def uses_amplitude(self) -> bool:
        """Whether a power of the amplitude occurs."""
        return len(self.sigma[0]) > 1 or len(self.mu[0]) > 1

    def build(self) -> "GaussianPolynomial":
        """The model itself: its TOML keys are its fields."""
        return self

    def mean(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Mean offset μ(x, a) [m], the same for every pixel."""
        return self._polynomial(self.mu, x, a)

    def deviation(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Standard deviation σ(x, a) [m], the same for every pixel."""
        return np.maximum(self._polynomial(self.sigma, x, a), self.least_sigma)

    def _polynomial(self, table: Table, x: NDArray[np.float64], a: NDArray[np.float64]) -> NDArray[np.float64]:
        coefficients = np.asarray(table)
        if coefficients.size == 1:
            return np.full(np.shape(x), coefficients[0, 0])
        if coefficients.shape[1] == 1:  # an amplitude that nothing depends on may be missing (NaN)
            return np.asarray(polyval(np.clip(x, *self.distances), coefficients[:, 0]), np.float64)
        x, a = np.clip(x, *self.distances), np.clip(a, *self.amplitudes)
        return np.asarray(polyval2d(x, a, coefficients), np.float64)


Settings = GaussianPolynomial
