"""Candidate noise models, from few coefficients to many."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial

import numpy as np
from numpy.typing import NDArray

from calib.noise import constant, gaussian_polynomial, per_pixel, region_polynomial, structured_light, tof_amplitude
from calib.noise.base import DepthNoise
from calib.noise.fit.samples import Samples
from calib.noise.per_pixel import PerPixel
from calib.sequences.evidence import Evidence
from calib.sequences.steps import Steps

#: Candidate degrees (distance, amplitude) of σ and μ; those of μ only if true distances are known.
WITHOUT_AMPLITUDE = ((1, 0), (2, 0), (3, 0))
WITH_AMPLITUDE = ((1, 1), (2, 1), (2, 2), (3, 2))

#: Candidate degrees of the mean offset of `tof_amplitude` in the distance.
TOF_POWERS = (0, 1, 2, 3, 4, 5)

#: Regions along the shorter side of an image.
_REGIONS = 8


class Level(StrEnum):
    """Scope of one set of coefficients."""

    IMAGE = "image"
    REGION = "region"
    PIXEL = "pixel"


@dataclass(frozen=True, slots=True)
class Candidate:
    """Candidate model.

    Attributes:
        name: its type in a rig file and its degrees, for display.
        level: scope of its coefficients.
        coefficients: number for the image, or for every place.
        fit: from evidence to the model; raises `NoiseError` if the evidence does not determine the coefficients.
    """

    name: str
    level: Level
    coefficients: int
    fit: Callable[[Evidence], DepthNoise]


def of_image(offsets: bool, amplitudes: bool, steps: Steps) -> list[Candidate]:
    """Models with one set of coefficients for the whole image, fewest coefficients first.

    Args:
        offsets: True if true distances, and so mean offsets, are known.
        amplitudes: True if there are amplitudes.
        steps: quantisation of the distances.
    """
    found = [_image("constant", 1 + offsets, _constant, offsets)]
    if steps.growth > 0:
        found.append(_image("structured_light", 2, lambda s: structured_light.fit(s, steps.growth), True))
    for degrees in WITHOUT_AMPLITUDE + (WITH_AMPLITUDE if amplitudes else ()):
        found.append(_polynomial(degrees, offsets))
    for power in (TOF_POWERS if offsets else TOF_POWERS[:1]) if amplitudes else ():
        found.append(_tof(power, offsets))
    return sorted(found, key=lambda one: one.coefficients)


def of_places(law: Candidate, shape: tuple[int, int], own_degree: int) -> list[Candidate]:
    """The image's model with maps of the differences between regions, and between pixels.

    Args:
        law: candidate for the image.
        shape: height and width of the images.
        own_degree: degree of the own mean offset of a region or a pixel in the distance.
    """
    labels = blocks(shape)

    def fitted(fit: Callable[..., PerPixel], evidence: Evidence) -> PerPixel:
        means, repeats = evidence.means, evidence.repeats
        first = fit(means, law.fit(evidence), labels, own_degree, repeats)
        # The image's σ includes the variation between places; it is refitted without it.
        return fit(means, law.fit(_without_own(first, evidence)), labels, own_degree, repeats)

    n = own_degree + 2
    return [
        Candidate(
            f"per_pixel, alike in a region, of {law.name}", Level.REGION, n, partial(fitted, per_pixel.fit_regions)
        ),
        Candidate(f"per_pixel of {law.name}", Level.PIXEL, n, partial(fitted, per_pixel.fit)),
    ]


def blocks(shape: tuple[int, int]) -> NDArray[np.int64]:
    """Labels (height, width) of square regions of an image."""
    return region_polynomial.blocks(*shape, side=max(1, -(-min(shape) // _REGIONS)))


def _without_own(model: PerPixel, evidence: Evidence) -> Evidence:
    """Single measurements minus the fixed errors of their places."""
    samples = evidence.samples
    x, a, p = samples.true, samples.amplitude, samples.pixels
    own = model.mean(x, a, p) - model.model.mean(x, a, p)
    return replace(evidence, samples=replace(samples, measured=samples.measured - own))


def _image(name: str, coefficients: int, fit: Callable[[Samples], DepthNoise], offsets: bool) -> Candidate:
    return Candidate(name, Level.IMAGE, coefficients, lambda evidence: _with(fit(evidence.samples), offsets))


def _with(model: DepthNoise, offsets: bool) -> DepthNoise:
    """The model, with zero mean offset if true distances are unknown."""
    match model:
        case constant.Constant() if not offsets:
            return replace(model, offset=0.0)
        case gaussian_polynomial.GaussianPolynomial() if not offsets:
            return replace(model, mu=((0.0,),))
        case tof_amplitude.TofAmplitude() if not offsets:
            return replace(model, mu=(0.0,), mu_amplitude=0.0)
    return model


def _constant(samples: Samples) -> DepthNoise:
    return constant.fit(samples)


def _polynomial(degrees: tuple[int, int], offsets: bool) -> Candidate:
    mu = degrees if offsets else (0, 0)
    n = (degrees[0] + 1) * (degrees[1] + 1) * (1 + offsets)
    name = f"gaussian_polynomial of degrees {degrees[0]} in x, {degrees[1]} in a"
    return _image(name, n, lambda samples: gaussian_polynomial.fit(samples, degrees, mu), offsets)


def _tof(power: int, offsets: bool) -> Candidate:
    name = f"tof_amplitude, μ of degree {power}" if offsets else "tof_amplitude"
    n = 3 + (power + 2) * offsets
    return _image(name, n, lambda samples: tof_amplitude.fit(samples, mu_degree=power), offsets)
