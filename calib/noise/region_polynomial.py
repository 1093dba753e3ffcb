"""Mean and deviation as polynomials in distance and amplitude (eq. 18), one pair for every region of the image."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.noise.base import NoiseError, Pixels
from calib.noise.fit import fitting, maps, shrinkage
from calib.noise.fit.polynomial import Polynomials
from calib.noise.fit.samples import Samples


@dataclass(frozen=True, eq=False)
class RegionPolynomial:
    """μ_r(x, a) = Σ mu[i, j, r] xⁱ aʲ, likewise σ_r, for the region r that contains the pixel.

    Attributes:
        labels: region (height, width) of every pixel, 0 to regions − 1.
        sigma, mu: coefficients (i, j, regions) [m].
        distances, amplitudes: calibrated domain, shape (2,); arguments are clamped to it.
        minimum_sigma: lower bound of the deviation [m].
    """

    labels: NDArray[np.integer]
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
        height, width = self.labels.shape
        return height, width

    def mean(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Mean offset μ_r(x, a) [m]."""
        return self._polynomials.mean(x, a, self.labels[p])

    def deviation(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Standard deviation σ_r(x, a) [m]."""
        return self._polynomials.deviation(x, a, self.labels[p])

    def save(self, file: Path) -> None:
        """Writes the .npz that `Settings` reads."""
        np.savez_compressed(file, **vars(self))

    @property
    def _polynomials(self) -> Polynomials:
        return Polynomials(self.sigma, self.mu, tuple(self.distances), tuple(self.amplitudes), self.minimum_sigma)


@dataclass(frozen=True)
class Settings:
    """TOML keys.

    Attributes:
        file: an .npz with the arrays labels (height, width), sigma, mu (i, j, regions), distances (2,), amplitudes (2,)
            and optionally minimum_sigma (), by default 1e-4.
    """

    file: Path

    def build(self) -> RegionPolynomial:
        """Loads labels and coefficients.

        Raises:
            NoiseError: missing file or array, wrong shape, or a region without coefficients.
        """
        arrays = maps.load(self.file, {"labels", "sigma", "mu"})
        labels, sigma, mu = arrays["labels"], arrays["sigma"], arrays["mu"]
        if sigma.ndim != 3 or mu.ndim != 3 or sigma.shape[2] != mu.shape[2]:
            raise NoiseError(f"sigma and mu in {str(self.file)!r} must be (i, j, regions) of as many regions")
        if labels.ndim != 2 or not np.issubdtype(labels.dtype, np.integer):
            raise NoiseError(f"labels in {str(self.file)!r} must be whole numbers (height, width)")
        if labels.min() < 0 or labels.max() >= sigma.shape[2]:
            raise NoiseError(
                f"labels in {str(self.file)!r} must be 0 to {sigma.shape[2] - 1}, the regions that sigma and mu have, "
                f"not {labels.min()} to {labels.max()}"
            )
        minimum = float(arrays["minimum_sigma"])
        return RegionPolynomial(labels.astype(np.int64), sigma, mu, arrays["distances"], arrays["amplitudes"], minimum)


def blocks(height: int, width: int, side: int) -> NDArray[np.int64]:
    """Labels (height, width) of square regions of `side` pixels, row by row."""
    rows, columns = np.indices((height, width)) // side
    return rows * (columns.max() + 1) + columns


def fit(
    samples: Samples,
    labels: NDArray[np.integer],
    sigma_degrees: tuple[int, int],
    mu_degrees: tuple[int, int],
    own_degree: int = 1,
) -> RegionPolynomial:
    """Fits the image's polynomials, and each region relative to them, with shrinkage.

    Args:
        samples: measurements.
        labels: region (height, width) of every pixel, from 0; for example `blocks`.
        sigma_degrees, mu_degrees: the image's degrees in distance and amplitude.
        own_degree: degree of a region's own mean offset in the distance. Its own deviation is a factor.

    Raises:
        NoiseError: no sample has a distance or, if the polynomials use it, an amplitude; or the samples vary too little
            for these degrees.
    """
    image = fitting.polynomials(samples, sigma_degrees, mu_degrees)
    samples = samples.returns(with_amplitude=image.use_amplitude)
    parents = np.zeros(int(labels.max()) + 1, np.int64)
    law = shrinkage.refine(image, parents, samples, labels[samples.pixels], own_degree)
    domain = np.array(law.distances), np.array(law.amplitudes)
    return RegionPolynomial(labels, law.sigma, law.mu, *domain, law.minimum_sigma)
