"""Any noise model of the whole image, with an own mean offset and factor on the deviation for every pixel."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.noise.base import DepthNoise, NoiseError, Pixels
from calib.noise.fit import fitting, maps, shrinkage
from calib.noise.fit.polynomial import Span, evaluate
from calib.noise.fit.samples import Samples, domain
from calib.noise.fit.shrinkage import ONCE, Repeats

#: Domain of the amplitude, which a pixel's own offset does not use.
_ANY: Span = (0.0, 1.0)


@dataclass(frozen=True, eq=False)
class PerPixel:
    """μ_p(x, a) = μ(x, a) + Σ offset[k, p] tᵏ and σ_p(x, a) = factor[p] σ(x, a).

    The image's model gives the dependence on distance and amplitude, the maps the differences between pixels. Where the
    amplitude varies much, this is more accurate than polynomials with separate coefficients for every pixel.

    Attributes:
        model: noise model of the image.
        offset: coefficients of a pixel's own mean offset (k, height, width) [m] in powers of t, which is −1 at the
            first and 1 at the second of `distances`, and clamped outside.
        factor: factor on the deviation (height, width).
        distances: calibrated domain, shape (2,).
        minimum_sigma: lower bound of the deviation [m].
    """

    model: DepthNoise
    offset: NDArray[np.floating]
    factor: NDArray[np.floating]
    distances: NDArray[np.floating]
    minimum_sigma: float = maps.MIN_SIGMA

    @property
    def uses_amplitude(self) -> bool:
        """True if the image's model uses it."""
        return self.model.uses_amplitude

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the images."""
        height, width = self.factor.shape
        return height, width

    def mean(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Mean offset μ_p(x, a) [m]."""
        near, far = self.distances
        t = np.clip((2 * np.asarray(x, np.float64) - near - far) / (far - near), -1, 1)
        place = np.asarray(p[0] * self.factor.shape[1] + p[1])
        table = self.offset.reshape(len(self.offset), 1, -1)
        return self.model.mean(x, a, p) + evaluate(table, place, t, np.zeros(1), (-1.0, 1.0), _ANY)

    def deviation(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Standard deviation σ_p(x, a) [m]."""
        return np.maximum(self.factor[p] * self.model.deviation(x, a, p), self.minimum_sigma)

    def save(self, file: Path) -> None:
        """Writes the .npz that `Settings` reads; the image's model is not part of it."""
        np.savez_compressed(
            file, offset=self.offset, factor=self.factor, distances=self.distances, minimum_sigma=self.minimum_sigma
        )


@dataclass(frozen=True)
class Settings:
    """TOML keys.

    Attributes:
        file: an .npz with the arrays offset (k, height, width) [m], factor (height, width), distances (2,) [m] and
            optionally minimum_sigma (), by default 1e-4.
        model: noise model of the image, a table with its `type` and keys.
    """

    file: Path
    model: Any = field(metadata={"parts": "calib.noise"})

    def build(self) -> PerPixel:
        """Builds the image's model and loads the maps.

        Raises:
            NoiseError: missing file or array, wrong shape, or `model` is not a depth noise model.
        """
        model = self.model.build()
        if not isinstance(model, DepthNoise):
            raise NoiseError(f"model must be a noise model of depth, not {type(model).__name__}")
        arrays = maps.arrays(self.file, {"offset", "factor", "distances"})
        offset, factor, distances = arrays["offset"], arrays["factor"], arrays["distances"]
        if offset.ndim != 3 or factor.ndim != 2 or offset.shape[1:] != factor.shape or not len(offset):
            raise NoiseError(
                f"offset and factor in {str(self.file)!r} must be (k, height, width) and (height, width) of one size"
            )
        if not np.all(factor > 0):
            raise NoiseError(f"factor in {str(self.file)!r} must be above 0")
        maps.check_domain(self.file, arrays, "distances")
        return PerPixel(model, offset, factor, distances, maps.minimum_sigma(self.file, arrays))


def fit(
    samples: Samples,
    model: DepthNoise,
    labels: NDArray[np.integer],
    own_degree: int = 1,
    repeats: Repeats = ONCE,
) -> PerPixel:
    """Fits regions relative to the image's model, and pixels relative to their region, with shrinkage.

    Args:
        samples: measurements, or means of many measurements by one pixel.
        model: noise model of the image, fitted to the same measurements.
        labels: region (height, width) of every pixel, from 0; for example `region_polynomial.blocks`.
        own_degree: degree of a region's or a pixel's own mean offset in the distance.
        repeats: replicates of the samples.

    Raises:
        NoiseError: no sample has a distance or, if the model uses it, an amplitude.
    """
    samples, repeats = _returns(samples, repeats, model)
    regions = fit_regions(samples, model, labels, own_degree, repeats)
    residual, deviation = _from(regions, samples)
    basis = shrinkage.basis_of(samples.true, tuple(regions.distances), own_degree)
    place = samples.row * labels.shape[1] + samples.column
    offsets, factors = shrinkage.shrink(residual, deviation, basis, place, labels.size, repeats, samples.minimum_sigma)
    factors[np.bincount(place, minlength=labels.size) == 0] = 1.0  # pixels without samples equal their region
    return PerPixel(
        model,
        regions.offset + offsets.T.reshape(-1, *labels.shape),
        regions.factor * factors.reshape(labels.shape),
        regions.distances,
        fitting.minimum_sigma(factors[place] * deviation),
    )


def fit_regions(
    samples: Samples,
    model: DepthNoise,
    labels: NDArray[np.integer],
    own_degree: int = 1,
    repeats: Repeats = ONCE,
) -> PerPixel:
    """Fits regions relative to the image's model; pixels equal their region, see `fit`."""
    samples, repeats = _returns(samples, repeats, model)
    distances = domain(samples.true)
    residual = samples.residual - model.mean(samples.true, samples.amplitude, samples.pixels)
    deviation = model.deviation(samples.true, samples.amplitude, samples.pixels)
    basis = shrinkage.basis_of(samples.true, distances, own_degree)
    places = int(labels.max()) + 1
    of = labels[samples.pixels]
    offsets, factors = shrinkage.shrink(residual, deviation, basis, of, places, repeats, samples.minimum_sigma)
    minimum = fitting.minimum_sigma(factors[of] * deviation)
    return PerPixel(model, np.moveaxis(offsets[labels], -1, 0), factors[labels], np.array(distances), minimum)


def _returns(samples: Samples, repeats: Repeats, model: DepthNoise) -> tuple[Samples, Repeats]:
    """Samples that have what a model needs, and their replicates."""
    where = samples.where(with_amplitude=model.uses_amplitude)
    return samples.take(where), Repeats(*(one[where] if one.size == where.size else one for one in repeats))


def _from(model: PerPixel, samples: Samples) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Residuals (n,) from a model's mean, and its deviations [m]."""
    x, a, p = samples.true, samples.amplitude, samples.pixels
    return samples.residual - model.mean(x, a, p), model.deviation(x, a, p)
