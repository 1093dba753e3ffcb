"""Floors of σ: none is below the steps of its values, even where a pixel repeats one of them for ever."""

from pathlib import Path

import numpy as np
import pytest

from calib.noise import constant, gaussian_polynomial, per_pixel, pixel_polynomial, region_polynomial
from calib.noise.base import DepthNoise
from calib.noise.fit.samples import Samples, from_images
from calib.noise.region_polynomial import blocks
from calib.noise.tof_amplitude import TofAmplitude
from tests.calib.noise.models import own_of_pixels

HEIGHT, WIDTH = 12, 16
LABELS = blocks(HEIGHT, WIDTH, 4)
#: Step of the values, and deviation of what scatters besides [m].
STEP, SIGMA = 4e-3, 3e-3


def stuck(share: float, step: float = STEP) -> Samples:
    """Forty exposures at three distances; some pixels repeat one value at each."""
    random = np.random.default_rng(0)
    true = np.repeat([0.8, 1.2, 1.6], 40)[:, None, None]
    measured = true + SIGMA * random.standard_normal((120, HEIGHT, WIDTH))
    repeating = random.random((HEIGHT, WIDTH)) < share
    measured = np.where(repeating, true + 1e-3, measured)
    return from_images(measured, true, np.full(measured.shape, np.nan), step)


def of_pixels(samples: Samples) -> DepthNoise:
    return per_pixel.fit(samples, constant.fit(samples), LABELS)


def of_regions(samples: Samples) -> DepthNoise:
    return per_pixel.fit_regions(samples, constant.fit(samples), LABELS)


def of_pixel_polynomials(samples: Samples) -> DepthNoise:
    return pixel_polynomial.fit(samples, LABELS, (1, 0), (1, 0))


def of_region_polynomials(samples: Samples) -> DepthNoise:
    return region_polynomial.fit(samples, LABELS, (1, 0), (1, 0))


MAPS = (of_pixels, of_regions, of_pixel_polynomials, of_region_polynomials)


def everywhere(model: DepthNoise) -> np.ndarray:
    rows, columns = (part.ravel() for part in np.indices((HEIGHT, WIDTH)))
    x = np.full(rows.size, 1.2)
    return model.deviation(x, np.full(rows.size, 1.0), (rows, columns))


@pytest.mark.parametrize("fit", MAPS)
@pytest.mark.parametrize("share", [0.12, 0.6])
def test_pixels_that_repeat_one_value_are_not_better_than_its_steps(fit, share: float) -> None:
    sigma = everywhere(fit(stuck(share)))
    assert sigma.min() > 0.85 * STEP / np.sqrt(12)
    assert sigma.max() < 1.3 * np.hypot(SIGMA, STEP)


@pytest.mark.parametrize("fit", MAPS)
def test_without_steps_pixels_that_repeat_themselves_are_taken_for_stuck(fit) -> None:
    sigma = everywhere(fit(stuck(0.12, step=0.0)))
    assert sigma.min() > 0.02 * SIGMA
    assert np.median(sigma) == pytest.approx(SIGMA, rel=0.15)


@pytest.mark.parametrize("share", [0.6, 1.0])
def test_the_law_of_the_image_is_not_better_than_its_steps(share: float) -> None:
    samples = stuck(share)
    for model in (constant.fit(samples), gaussian_polynomial.fit(samples, (1, 0), (1, 0))):
        assert everywhere(model).min() > 0.85 * STEP / np.sqrt(12)


def test_maps_of_a_file_do_not_pass_below_the_least_deviation(tmp_path: Path) -> None:
    """A file of an older version, without `minimum_sigma` and with factors that had collapsed."""
    model = own_of_pixels()
    np.savez(tmp_path / "own.npz", offset=model.offset, factor=np.full(model.shape, 2e-9), distances=model.distances)
    read = per_pixel.Settings(tmp_path / "own.npz", TofAmplitude((1e-3,), 0.0)).build()
    assert read.deviation(np.ones(1), np.ones(1), (np.zeros(1, int), np.zeros(1, int))) == pytest.approx(1e-4)
