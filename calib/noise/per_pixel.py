"""Any law of the whole image, with a mean offset and a factor on the deviation that every pixel has for itself."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.noise.base import DepthNoise, NoiseError, Pixels
from calib.noise.fit import maps, shrinkage
from calib.noise.fit.polynomial import Span, evaluate
from calib.noise.fit.samples import Samples, domain
from calib.noise.fit.shrinkage import ONCE, Repeats

#: The amplitude does not occur in a pixel's own offset.
_ANY: Span = (0.0, 1.0)


@dataclass(frozen=True, eq=False)
class PerPixel:
    """μ_p(x, a) = μ(x, a) + Σ offset[k, p] tᵏ and σ_p(x, a) = factor[p] σ(x, a).

    The law says how errors depend on distance and amplitude, the maps how pixels differ. So it is right as far as the
    law is, which polynomials with coefficients of every pixel's own are not where the amplitude varies much.

    Attributes:
        law: μ and σ of the image.
        offset: coefficients of a pixel's own mean offset (k, height, width) [m] in powers of t, which is −1 at the
            first and 1 at the second of `distances`, and keeps its edge value beyond.
        factor: on the deviation (height, width).
        distances: calibrated domain, shape (2,).
    """

    law: DepthNoise
    offset: NDArray[np.floating]
    factor: NDArray[np.floating]
    distances: NDArray[np.floating]

    @property
    def uses_amplitude(self) -> bool:
        """Whether the law does."""
        return self.law.uses_amplitude

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the images that it is for."""
        height, width = self.factor.shape
        return height, width

    def mean(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Mean offset μ_p(x, a) [m]."""
        near, far = self.distances
        t = np.clip((2 * np.asarray(x, np.float64) - near - far) / (far - near), -1, 1)
        place = np.asarray(p[0] * self.factor.shape[1] + p[1])
        table = self.offset.reshape(len(self.offset), 1, -1)
        return self.law.mean(x, a, p) + evaluate(table, place, t, np.zeros(1), (-1.0, 1.0), _ANY)

    def deviation(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Standard deviation σ_p(x, a) [m]."""
        return self.factor[p] * self.law.deviation(x, a, p)

    def save(self, file: Path) -> None:
        """Writes the .npz that `Settings` reads, which does not hold the law."""
        np.savez_compressed(file, offset=self.offset, factor=self.factor, distances=self.distances)


@dataclass(frozen=True)
class Settings:
    """TOML keys.

    Attributes:
        file: an .npz with the arrays offset (k, height, width) [m], factor (height, width) and distances (2,) [m].
        law: another noise model, a table with its `type` and keys.
    """

    file: Path
    law: Any = field(metadata={"parts": "calib.noise"})

    def build(self) -> PerPixel:
        """Builds the law and loads the maps.

        Raises:
            NoiseError: the file or one of its arrays is missing or has the wrong shape, or the law is none of depth.
        """
        law = self.law.build()
        if not isinstance(law, DepthNoise):
            raise NoiseError(f"law must be a noise model of depth, not {type(law).__name__}")
        arrays = maps.arrays(self.file, {"offset", "factor", "distances"})
        offset, factor, distances = arrays["offset"], arrays["factor"], arrays["distances"]
        if offset.ndim != 3 or factor.ndim != 2 or offset.shape[1:] != factor.shape or not len(offset):
            raise NoiseError(
                f"offset and factor in {str(self.file)!r} must be (k, height, width) and (height, width) of one size"
            )
        if not (np.all(factor > 0) and np.all(np.isfinite(factor)) and np.all(np.isfinite(offset))):
            raise NoiseError(f"offset and factor in {str(self.file)!r} must be finite, and factor above 0")
        maps.check_domain(self.file, arrays, "distances")
        return PerPixel(law, offset, factor, distances)


def fit(
    samples: Samples,
    law: DepthNoise,
    labels: NDArray[np.integer],
    own_degree: int = 1,
    repeats: Repeats = ONCE,
) -> PerPixel:
    """How regions differ from the image as a law describes it, and pixels from their region, as far as samples tell.

    Args:
        samples: measurements, or means of many measurements by one pixel.
        law: μ and σ of the image, fitted to the same measurements.
        labels: region (height, width) of every pixel, 0 and up; such as `region_polynomial.blocks`.
        own_degree: highest power of the distance in a region's or a pixel's own mean offset.
        repeats: measurements that every sample is the mean of.

    Raises:
        NoiseError: no sample has a distance or, where the law depends on it, an amplitude.
    """
    regions = fit_regions(samples, law, labels, own_degree, repeats)
    residual, deviation = _from(regions, samples)
    basis = shrinkage.basis_of(samples.true, tuple(regions.distances), own_degree)
    place = samples.row * labels.shape[1] + samples.column
    offsets, factors = shrinkage.own(residual, deviation, basis, place, labels.size, repeats)
    factors[np.bincount(place, minlength=labels.size) == 0] = 1.0  # of those nothing is known, least of all an offset
    return PerPixel(
        law,
        regions.offset + offsets.T.reshape(-1, *labels.shape),
        regions.factor * factors.reshape(labels.shape),
        regions.distances,
    )


def fit_regions(
    samples: Samples,
    law: DepthNoise,
    labels: NDArray[np.integer],
    own_degree: int = 1,
    repeats: Repeats = ONCE,
) -> PerPixel:
    """The same with pixels that are like their region; arguments and errors as of `fit`."""
    samples.returns(with_amplitude=law.uses_amplitude)
    distances = domain(samples.true)
    residual = samples.residual - law.mean(samples.true, samples.amplitude, samples.pixels)
    deviation = law.deviation(samples.true, samples.amplitude, samples.pixels)
    basis = shrinkage.basis_of(samples.true, distances, own_degree)
    places = int(labels.max()) + 1
    offsets, factors = shrinkage.own(residual, deviation, basis, labels[samples.pixels], places, repeats)
    return PerPixel(law, np.moveaxis(offsets[labels], -1, 0), factors[labels], np.array(distances))


def _from(model: PerPixel, samples: Samples) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Residuals (n,) from a model's mean, and its deviations [m]."""
    x, a, p = samples.true, samples.amplitude, samples.pixels
    return samples.residual - model.mean(x, a, p), model.deviation(x, a, p)
