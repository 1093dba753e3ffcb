"""Mean and deviation as polynomials in distance and amplitude (eq. 18) with separate coefficients for every pixel."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.noise.base import NoiseError, Pixels
from calib.noise.fit import fitting, maps, shrinkage
from calib.noise.fit.polynomial import Polynomials
from calib.noise.fit.samples import Samples


@dataclass(frozen=True, eq=False)
class PixelPolynomial:
    """μ_p(x, a) = Σ mu[i, j, p] xⁱ aʲ, likewise σ_p; the paper's calibration (section 5.1).

    Attributes:
        sigma, mu: coefficients (i, j, height, width) [m].
        distances, amplitudes: calibrated domain, shape (2,); arguments are clamped to it.
        minimum_sigma: lower bound of the deviation [m].
    """

    sigma: NDArray[np.floating]
    mu: NDArray[np.floating]
    distances: NDArray[np.floating]
    amplitudes: NDArray[np.floating]
    minimum_sigma: float = 1e-4

    @property
    def uses_amplitude(self) -> bool:
        """True if a power of the amplitude occurs."""
        return self._polynomials.use_amplitude

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the images."""
        height, width = self.sigma.shape[2:]
        return height, width

    def mean(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Mean offset μ_p(x, a) [m]."""
        return self._polynomials.mean(x, a, self._place(p))

    def deviation(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Standard deviation σ_p(x, a) [m]."""
        return self._polynomials.deviation(x, a, self._place(p))

    def save(self, file: Path) -> None:
        """Writes the .npz that `Settings` reads."""
        np.savez_compressed(file, **vars(self))

    @property
    def _polynomials(self) -> Polynomials:
        sigma, mu = (part.reshape(*part.shape[:2], -1) for part in (self.sigma, self.mu))
        return Polynomials(sigma, mu, tuple(self.distances), tuple(self.amplitudes), self.minimum_sigma)

    def _place(self, p: Pixels) -> NDArray[np.integer]:
        return p[0] * self.sigma.shape[3] + p[1]


@dataclass(frozen=True)
class Settings:
    """TOML keys.

    Attributes:
        file: an .npz with the arrays sigma, mu (i, j, height, width), distances (2,), amplitudes (2,) and optionally
            minimum_sigma (), by default 1e-4.
    """

    file: Path

    def build(self) -> PixelPolynomial:
        """Loads the maps.

        Raises:
            NoiseError: missing file or array, or wrong shape.
        """
        arrays = maps.load(self.file, {"sigma", "mu"})
        sigma, mu = arrays["sigma"], arrays["mu"]
        if sigma.ndim != 4 or mu.ndim != 4 or sigma.shape[2:] != mu.shape[2:]:
            raise NoiseError(f"sigma and mu in {str(self.file)!r} must be (i, j, height, width) of one image size")
        return PixelPolynomial(sigma, mu, arrays["distances"], arrays["amplitudes"], float(arrays["minimum_sigma"]))


def fit(
    samples: Samples,
    labels: NDArray[np.integer],
    sigma_degrees: tuple[int, int],
    mu_degrees: tuple[int, int],
    own_degree: int = 1,
) -> PixelPolynomial:
    """Fits the image's polynomials, each region relative to them, and each pixel relative to its region.

    Shrinkage fills in for regions and pixels with few samples: 15 sequences are plenty for an image and few for a
        pixel.

    Args:
        samples: measurements.
        labels: region (height, width) of every pixel, from 0; for example `region_polynomial.blocks`.
        sigma_degrees, mu_degrees: the image's degrees in distance and amplitude.
        own_degree: degree of a region's or a pixel's own mean offset in the distance. Their own deviation is a factor.

    Raises:
        NoiseError: no sample has a distance or, if the polynomials use it, an amplitude; or the samples vary too little
            for these degrees.
    """
    image = fitting.polynomials(samples, sigma_degrees, mu_degrees)
    samples = samples.returns(with_amplitude=image.use_amplitude)
    parents = np.zeros(int(labels.max()) + 1, np.int64)
    regions = shrinkage.refine(image, parents, samples, labels[samples.pixels], own_degree)
    place = samples.row * labels.shape[1] + samples.column
    law = shrinkage.refine(regions, labels.ravel(), samples, place, own_degree)
    sigma, mu = (part.reshape(*part.shape[:2], *labels.shape) for part in (law.sigma, law.mu))
    return PixelPolynomial(sigma, mu, np.array(law.distances), np.array(law.amplitudes), law.minimum_sigma)
