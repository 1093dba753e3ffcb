"""Mean and deviation as polynomials in distance and amplitude (eq. 18), one pair for the whole image."""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray

from calib.noise.base import Pixels
from calib.noise.fit import fitting
from calib.noise.fit.polynomial import EVERYWHERE, Polynomials, Span, Table, check_span, check_table
from calib.noise.fit.samples import Samples


@dataclass(frozen=True)
class GaussianPolynomial:
    """μ(x, a) = Σ `mu[i][j]` xⁱ aʲ and σ(x, a) = Σ `sigma[i][j]` xⁱ aʲ, x in metres, a in the sensor's unit.

    Arguments are clamped to the calibrated domain and σ is at least `minimum_sigma`, so that extrapolation stays
    positive and bounded.

    Attributes:
        sigma: coefficients of the deviation [m]; row i for the distance's power i, column j for the amplitude's power
            j.
        mu: coefficients of the mean offset [m], likewise.
        distances: calibrated range of distances [m].
        amplitudes: calibrated range of amplitudes, in the sensor's unit.
        minimum_sigma: lower bound of the deviation [m].
    """

    sigma: Table
    mu: Table = ((0.0,),)
    distances: Span = (0.0, 100.0)
    amplitudes: Span = (0.0, 65535.0)
    minimum_sigma: Annotated[float, Gt(0)] = 1e-4

    def __post_init__(self) -> None:
        check_table("sigma", self.sigma)
        check_table("mu", self.mu)
        check_span("distances", self.distances)
        check_span("amplitudes", self.amplitudes)

    @property
    def uses_amplitude(self) -> bool:
        """True if a power of the amplitude occurs."""
        return len(self.sigma[0]) > 1 or len(self.mu[0]) > 1

    def build(self) -> "GaussianPolynomial":
        """The model itself: its TOML keys are its fields."""
        return self

    def mean(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Mean offset μ(x, a) [m], the same for every pixel."""
        return self._polynomials.mean(x, a, EVERYWHERE)

    def deviation(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Standard deviation σ(x, a) [m], the same for every pixel."""
        return self._polynomials.deviation(x, a, EVERYWHERE)

    @cached_property
    def _polynomials(self) -> Polynomials:
        sigma, mu = np.array(self.sigma)[..., None], np.array(self.mu)[..., None]
        return Polynomials(sigma, mu, self.distances, self.amplitudes, self.minimum_sigma)


Settings = GaussianPolynomial


def fit(samples: Samples, sigma_degrees: tuple[int, int], mu_degrees: tuple[int, int]) -> GaussianPolynomial:
    """Maximum-likelihood model; its domain is that of the samples.

    Args:
        samples: measurements.
        sigma_degrees, mu_degrees: degrees in distance and amplitude.

    Raises:
        NoiseError: no sample has a distance or, if the polynomials use it, an amplitude; or the samples vary too little
            for these degrees.
    """
    law = fitting.polynomials(samples, sigma_degrees, mu_degrees)
    sigma, mu = fitting.table(law.sigma[..., 0]), fitting.table(law.mu[..., 0])
    return GaussianPolynomial(sigma, mu, law.distances, law.amplitudes, law.minimum_sigma)
