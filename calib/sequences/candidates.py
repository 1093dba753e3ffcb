"""The noise models that are tried on the samples of a sensor, from few parameters to many."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from calib.noise import (
    constant,
    gaussian_polynomial,
    pixel_polynomial,
    region_polynomial,
    structured_light,
    tof_amplitude,
)
from calib.noise.base import DepthNoise
from calib.noise.samples import Samples
from calib.sequences.steps import Steps

#: Powers (of the distance, of the amplitude) of σ and μ that are tried; those of μ only if real distances are known.
WITHOUT_AMPLITUDE = ((0, 0), (1, 0), (2, 0), (3, 0))
WITH_AMPLITUDE = ((1, 1), (2, 1), (2, 2), (3, 2))

#: Powers of the distance in the mean offset of `tof_amplitude` that are tried.
TOF_POWERS = (0, 1, 2, 3, 4, 5)

#: Regions across the shorter side of an image.
_REGIONS = 8


class Level(StrEnum):
    """What shares one set of coefficients."""

    IMAGE = "image"
    REGION = "region"
    PIXEL = "pixel"


@dataclass(frozen=True, slots=True)
class Candidate:
    """A model that is tried.

    Attributes:
        type: its name in a rig file.
        detail: its powers, for people.
        level: what shares its coefficients.
        parameters: coefficients of a place.
        fit: from samples to the model; raises `NoiseError` where they do not tell its coefficients.
        degrees: powers of a polynomial's σ and μ; empty for another formula.
    """

    type: str
    detail: str
    level: Level
    parameters: int
    fit: Callable[[Samples], DepthNoise]
    degrees: tuple[tuple[int, int], ...] = ()

    @property
    def name(self) -> str:
        """Type and powers, for people."""
        return f"{self.type} {self.detail}".strip()


def of_image(offsets: bool, amplitudes: bool, steps: Steps) -> list[Candidate]:
    """Models with one set of coefficients for the whole image, fewest coefficients first.

    Args:
        offsets: whether real distances are known, and so mean offsets.
        amplitudes: whether there are amplitudes.
        steps: that the distances come in.
    """
    found = [Candidate("constant", "", Level.IMAGE, 1 + offsets, _constant(offsets))]
    if steps.growth > 0:
        found.append(Candidate("structured_light", "", Level.IMAGE, 2, lambda s: structured_light.fit(s, steps.growth)))
    for degrees in WITHOUT_AMPLITUDE[1:] + (WITH_AMPLITUDE if amplitudes else ()):
        found.append(_polynomial(degrees, degrees if offsets else (0, 0), offsets))
    if amplitudes:
        found += [_tof(power, offsets) for power in (TOF_POWERS if offsets else TOF_POWERS[:1])]
    return sorted(found, key=lambda one: one.parameters)


def of_places(degrees: tuple[tuple[int, int], ...], shape: tuple[int, int], own_degree: int) -> list[Candidate]:
    """The same polynomials with coefficients of regions', and of pixels' own.

    Args:
        degrees: powers of σ and μ.
        shape: height and width of the images.
        own_degree: highest power of the distance in the own mean offset of a region or a pixel.
    """
    labels = blocks(shape)
    sigma, mu = degrees
    own = {"sigma_degrees": sigma, "mu_degrees": mu, "own_degree": own_degree}
    n, detail = own_degree + 2, _powers(sigma, mu)
    return [
        Candidate(
            "region_polynomial", detail, Level.REGION, n, lambda s: region_polynomial.fit(s, labels, **own), degrees
        ),
        Candidate(
            "pixel_polynomial", detail, Level.PIXEL, n, lambda s: pixel_polynomial.fit(s, labels, **own), degrees
        ),
    ]


def blocks(shape: tuple[int, int]) -> NDArray[np.int64]:
    """Square regions (height, width) of an image."""
    return region_polynomial.blocks(*shape, side=max(1, -(-min(shape) // _REGIONS)))


def _constant(offsets: bool) -> Callable[[Samples], DepthNoise]:
    def fit(samples: Samples) -> DepthNoise:
        model = constant.fit(samples)
        return model if offsets else replace(model, offset=0.0)

    return fit


def _polynomial(sigma: tuple[int, int], mu: tuple[int, int], offsets: bool) -> Candidate:
    def fit(samples: Samples) -> DepthNoise:
        model = gaussian_polynomial.fit(samples, sigma, mu)
        return model if offsets else replace(model, mu=((0.0,),))

    n = (sigma[0] + 1) * (sigma[1] + 1) + (mu[0] + 1) * (mu[1] + 1) * offsets
    return Candidate("gaussian_polynomial", _powers(sigma, mu), Level.IMAGE, n, fit, (sigma, mu))


def _tof(power: int, offsets: bool) -> Candidate:
    def fit(samples: Samples) -> DepthNoise:
        model = tof_amplitude.fit(samples, mu_degree=power)
        return model if offsets else replace(model, mu=(0.0,), mu_amplitude=0.0)

    detail = f"(μ of degree {power})" if offsets else ""
    return Candidate("tof_amplitude", detail, Level.IMAGE, 3 + (power + 2) * offsets, fit)


def _powers(sigma: tuple[int, int], mu: tuple[int, int]) -> str:
    return f"(σ of degrees {sigma[0]}, {sigma[1]}; μ {mu[0]}, {mu[1]})"
