"""Mean and deviation as polynomials in distance and amplitude (eq. 18) with coefficients of every pixel's own."""

from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.lib.npyio import NpzFile
from numpy.typing import NDArray

from calib.noise.base import NoiseError, Pixels


@dataclass(frozen=True, eq=False)
class PixelPolynomial:
    """μ_p(x, a) = Σ mu[i, j, p] xⁱ aʲ, likewise σ_p; the form in which the paper's calibration (5.1) is stored.

    Attributes:
        sigma, mu: coefficients (i, j, height, width) [m].
        distances, amplitudes: calibrated domain, shape (2,); the polynomials keep their edge value outside.
        least_sigma: lower bound of the deviation [m].
    """

    sigma: NDArray[np.float64]
    mu: NDArray[np.float64]
    distances: NDArray[np.float64]
    amplitudes: NDArray[np.float64]
    least_sigma: float = 1e-4

    @property
    def uses_amplitude(self) -> bool:
        """Whether a power of the amplitude occurs."""
        return self.sigma.shape[1] > 1 or self.mu.shape[1] > 1

    def mean(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Mean offset μ_p(x, a) [m]."""
        return self._polynomial(self.mu, x, a, p)

    def deviation(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Standard deviation σ_p(x, a) [m]."""
        return np.maximum(self._polynomial(self.sigma, x, a, p), self.least_sigma)

    def _polynomial(
        self, coefficients: NDArray[np.float64], x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels
    ) -> NDArray[np.float64]:
        x, a = np.clip(x, *self.distances), np.clip(a, *self.amplitudes)
        if coefficients.shape[1] == 1:  # an amplitude that nothing depends on may be missing (NaN)
            a = np.zeros_like(x)
        value = np.zeros_like(x)
        for row in coefficients[::-1]:
            inner = np.zeros_like(x)
            for plane in row[::-1]:
                inner = inner * a + plane[p]
            value = value * x + inner
        return value


@dataclass(frozen=True)
class Settings:
    """TOML keys: `file`, an .npz with the arrays sigma, mu (i, j, height, width), distances (2,), amplitudes (2,)."""

    file: Path

    def build(self) -> PixelPolynomial:
        """Loads the maps.

        Raises:
            NoiseError: the file or one of its arrays is missing or has the wrong shape.
        """
        try:
            with self.file.open("rb") as stream, NpzFile(stream) as archive:
                arrays = dict(archive)
        except (OSError, ValueError, BadZipFile) as error:
            raise NoiseError(f"file = {str(self.file)!r} cannot be read as .npz: {error}") from error
        missing = {"sigma", "mu", "distances", "amplitudes"} - set(arrays)
        if missing:
            raise NoiseError(f"file = {str(self.file)!r} lacks the array(s) {sorted(missing)}")
        sigma, mu = arrays["sigma"], arrays["mu"]
        if sigma.ndim != 4 or mu.ndim != 4 or sigma.shape[2:] != mu.shape[2:]:
            raise NoiseError(f"sigma and mu in {str(self.file)!r} must be (i, j, height, width) of one image size")
        for key in ("distances", "amplitudes"):
            if arrays[key].shape != (2,) or not arrays[key][0] < arrays[key][1]:
                raise NoiseError(f"{key} in {str(self.file)!r} must be [lowest, highest], not {arrays[key].tolist()}")
        return PixelPolynomial(sigma, mu, arrays["distances"], arrays["amplitudes"])
