"""The noise models that are tried on what a sensor measured, from few coefficients to many."""

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

#: Powers (of the distance, of the amplitude) of σ and μ that are tried; those of μ only if real distances are known.
WITHOUT_AMPLITUDE = ((1, 0), (2, 0), (3, 0))
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
        name: its type in a rig file, and its powers, for people.
        level: what shares its coefficients.
        coefficients: of the image, or of every place.
        fit: from evidence to the model; raises `NoiseError` where that does not tell its coefficients.
    """

    name: str
    level: Level
    coefficients: int
    fit: Callable[[Evidence], DepthNoise]


def of_image(offsets: bool, amplitudes: bool, steps: Steps) -> list[Candidate]:
    """Models with one set of coefficients for the whole image, fewest coefficients first.

    Args:
        offsets: whether real distances are known, and so mean offsets.
        amplitudes: whether there are amplitudes.
        steps: that the distances come in.
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
    """A law of the image with maps of how regions, and how pixels, differ.

    Args:
        law: of the image.
        shape: height and width of the images.
        own_degree: highest power of the distance in the own mean offset of a region or a pixel.
    """
    labels = blocks(shape)

    def fitted(fit: Callable[..., PerPixel], evidence: Evidence) -> PerPixel:
        means, repeats = evidence.means, evidence.repeats
        first = fit(means, law.fit(evidence), labels, own_degree, repeats)
        # The law's σ had to cover what the places differ by; without that it is the places' own, and of another shape.
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
    """The single measurements without what places err by for themselves."""
    samples = evidence.samples
    x, a, p = samples.true, samples.amplitude, samples.pixels
    own = model.mean(x, a, p) - model.law.mean(x, a, p)
    return replace(evidence, samples=replace(samples, measured=samples.measured - own))


def _image(name: str, coefficients: int, fit: Callable[[Samples], DepthNoise], offsets: bool) -> Candidate:
    return Candidate(name, Level.IMAGE, coefficients, lambda evidence: _with(fit(evidence.samples), offsets))


def _with(model: DepthNoise, offsets: bool) -> DepthNoise:
    """The model, without mean offsets where nothing is known of them."""
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
