"""Time of flight: error that grows as the amplitude falls (Frank et al., Optical Engineering 2009)."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.polynomial.polynomial import polyvander
from numpy.typing import NDArray

from calib.noise.base import NoiseError, Pixels
from calib.noise.fit import fitting
from calib.noise.fit.polynomial import EVERYWHERE, Span, check_span, evaluate
from calib.noise.fit.samples import Samples, domain


@dataclass(frozen=True)
class TofAmplitude:
    """σ(x, a) = Σ sigma[i] xⁱ + sigma_amplitude / a and μ(x, a) = Σ mu[i] xⁱ + mu_amplitude / a.

    The phase is computed from four charges; the deviation of its angle, and so of the distance, is that of a charge
    over the amplitude. Errors that do not depend on it (jitter of the light source, rounding) are the polynomial in the
    distance. In `mu` the polynomial covers the slow part of the periodic ("wiggling") error, and mu_amplitude / a the
    offset of dark surfaces. This has fewer parameters than a polynomial in the amplitude and extrapolates correctly.
    Arguments are clamped to the calibrated domain, and σ is at least `minimum_sigma`.

    Attributes:
        sigma: deviation of a bright return, coefficients of the powers of the distance [m].
        sigma_amplitude: deviation times amplitude [m times the sensor's amplitude unit].
        mu: mean offset of a bright return, coefficients of the powers of the distance [m].
        mu_amplitude: mean offset times amplitude [m times the sensor's amplitude unit].
        distances: calibrated range of distances [m].
        amplitudes: calibrated range of amplitudes, above 0, in the sensor's unit.
        minimum_sigma: lower bound of the deviation [m].
    """

    sigma: tuple[float, ...]
    sigma_amplitude: Annotated[float, Ge(0)]
    mu: tuple[float, ...] = (0.0,)
    mu_amplitude: float = 0.0
    distances: Span = (0.0, 100.0)
    amplitudes: Span = (1.0, 65535.0)
    minimum_sigma: Annotated[float, Gt(0)] = 1e-4

    def __post_init__(self) -> None:
        for key, powers in (("sigma", self.sigma), ("mu", self.mu)):
            if not powers:
                raise NoiseError(f"{key} must be a list of numbers, {key}[i] for the distance's power i, not []")
        check_span("distances", self.distances)
        check_span("amplitudes", self.amplitudes)
        if not self.amplitudes[0] > 0:
            raise NoiseError(f"amplitudes must begin above 0, where the noise is infinite, not {list(self.amplitudes)}")

    @property
    def uses_amplitude(self) -> bool:
        """True if a coefficient of 1/a is not zero."""
        return self.sigma_amplitude != 0 or self.mu_amplitude != 0

    def build(self) -> "TofAmplitude":
        """The model itself: its TOML keys are its fields."""
        return self

    def mean(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Mean offset μ(x, a) [m], the same for every pixel."""
        return self._law(self.mu, self.mu_amplitude, x, a)

    def deviation(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Standard deviation σ(x, a) [m], the same for every pixel."""
        return np.maximum(self._law(self.sigma, self.sigma_amplitude, x, a), self.minimum_sigma)

    def _law(
        self, powers: tuple[float, ...], per_amplitude: float, x: NDArray[np.float64], a: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Polynomial of degree one in 1/a, evaluated by the common kernel."""
        table = np.zeros((len(powers), 2 if per_amplitude else 1, 1))
        table[:, 0, 0] = powers
        table[0, 1:, 0] = per_amplitude
        faintest, brightest = self.amplitudes
        inverse = 1 / np.clip(a, faintest, brightest)
        return evaluate(table, EVERYWHERE, x, inverse, self.distances, (1 / brightest, 1 / faintest))


Settings = TofAmplitude


def fit(samples: Samples, sigma_degree: int = 1, mu_degree: int = 1) -> TofAmplitude:
    """Maximum-likelihood model; its domain is that of the samples.

    Args:
        samples: measurements with amplitudes.
        sigma_degree, mu_degree: degrees in the distance.

    Raises:
        NoiseError: no sample has a distance and an amplitude, or they vary too little for these degrees.
    """
    samples = fitting.subsampled(samples.returns(with_amplitude=True))
    distances, amplitudes = domain(samples.true), domain(samples.amplitude)
    x, inverse = np.clip(samples.true, *distances), 1 / np.clip(samples.amplitude, *amplitudes)
    mean, spread = (np.column_stack([polyvander(x, degree), inverse]) for degree in (mu_degree, sigma_degree))
    minimum = samples.minimum_sigma
    law = fitting.maximize_likelihood(samples.residual, fitting.Design(mean, spread), minimum=minimum)
    if law.spread[-1] < 0:  # errors that grow with amplitude contradict the model; use the distance only
        law = fitting.maximize_likelihood(samples.residual, fitting.Design(mean, spread[:, :-1]), minimum=minimum)
    per_amplitude = float(law.spread[sigma_degree + 1]) if len(law.spread) > sigma_degree + 1 else 0.0
    return TofAmplitude(
        sigma=tuple(law.spread[: sigma_degree + 1].tolist()),
        sigma_amplitude=per_amplitude,
        mu=tuple(law.mean[:-1].tolist()),
        mu_amplitude=float(law.mean[-1]),
        distances=distances,
        amplitudes=amplitudes,
        minimum_sigma=fitting.minimum_sigma(np.maximum(spread[:, : len(law.spread)] @ law.spread, minimum)),
    )
