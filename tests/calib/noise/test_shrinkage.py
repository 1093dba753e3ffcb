"""Regions and pixels have what their samples tell of their own, and what they do not tell of what they are part of."""

import dataclasses

import numpy as np
import pytest

from calib.noise import gaussian_polynomial, pixel_polynomial, region_polynomial
from calib.noise.fit.quality import goodness_of_fit
from calib.noise.fit.samples import Samples, from_images
from calib.noise.region_polynomial import blocks

HEIGHT, WIDTH = 18, 24
LABELS = blocks(HEIGHT, WIDTH, 6)
#: Of the deviation and of the mean offset, in distance and amplitude.
DEGREES = (1, 2), (1, 0)


class Head:
    """A time-of-flight head whose every pixel has an offset, a slope and a factor on σ, around smooth ones."""

    def __init__(self, seed: int):
        generator = np.random.default_rng(seed)
        rows, columns = np.indices((HEIGHT, WIDTH))
        smooth = 4e-3 * np.sin(rows / 5) + 3e-3 * np.cos(columns / 5)
        self.offset = smooth + 2e-3 * generator.standard_normal((HEIGHT, WIDTH))
        self.slope = 2e-3 * generator.standard_normal((HEIGHT, WIDTH))
        self.factor = (1 + 0.5 * rows / HEIGHT) * np.exp(0.2 * generator.standard_normal((HEIGHT, WIDTH)))

    def mean(self, x, p):
        return self.offset[p] + self.slope[p] * (x - 1.5)

    def sigma(self, x, a, p):
        return self.factor[p] * (2e-3 + 5e-4 * x + 3 / a)

    def boards(self, seed: int, frames: int, outliers: float = 0.02) -> Samples:
        """The paper's calibration (5.1): boards of three materials at five distances, some frames of each."""
        generator = np.random.default_rng(seed)
        x, white = np.meshgrid([0.75, 1.2, 1.6, 2.1, 2.6], [2000.0, 5000.0, 9000.0])
        x, white = (np.repeat(part.ravel(), frames)[:, None, None] for part in (x, white))
        a = white / x**2 + 25 * generator.standard_normal((len(x), HEIGHT, WIDTH))
        samples = from_images(np.ones_like(a), np.broadcast_to(x, a.shape), np.maximum(a, 200))
        spread = self.sigma(samples.true, samples.amplitude, samples.pixels) * generator.standard_normal(len(samples))
        measured = samples.true + self.mean(samples.true, samples.pixels) + spread
        lost = generator.random(len(samples)) < outliers
        measured[lost] = generator.uniform(0.1, 5, lost.sum())
        return dataclasses.replace(samples, measured=measured)


@pytest.fixture(scope="module")
def head():
    return Head(1)


@pytest.fixture(scope="module")
def held_out(head):
    return head.boards(99, 2, outliers=0.0)


def rms_offset(model, head, samples):
    mean = model.mean(samples.true, samples.amplitude, samples.pixels)
    return np.sqrt(np.mean((mean - head.mean(samples.true, samples.pixels)) ** 2))


@pytest.mark.parametrize("frames", [1, 6])
def test_each_level_explains_unseen_samples_better_than_the_one_above(head, held_out, frames):
    samples = head.boards(2, frames)
    models = [
        gaussian_polynomial.fit(samples, *DEGREES),
        region_polynomial.fit(samples, LABELS, *DEGREES),
        pixel_polynomial.fit(samples, LABELS, *DEGREES),
    ]
    image, region, pixel = (goodness_of_fit(model, held_out) for model in models)
    assert image.log_likelihood + 0.02 < region.log_likelihood < pixel.log_likelihood - 0.02
    assert pixel.variance == pytest.approx(1, abs=0.25 if frames == 1 else 0.1)
    assert pixel.within_one == pytest.approx(0.683, abs=0.03)
    assert pixel.within_95 == pytest.approx(0.95, abs=0.03 if frames == 1 else 0.015)


def test_with_many_samples_pixels_are_found_again(head, held_out):
    model = pixel_polynomial.fit(head.boards(3, 20), LABELS, *DEGREES)
    assert rms_offset(model, head, held_out) < 1e-3
    x, a, p = held_out.true, held_out.amplitude, held_out.pixels
    assert np.sqrt(np.mean((model.deviation(x, a, p) / head.sigma(x, a, p) - 1) ** 2)) < 0.2


def test_thin_data_are_better_shrunk_than_taken_at_their_word(head, held_out):
    """Fifteen samples a pixel, against each pixel's own mean and slope by least squares without outliers."""
    samples = head.boards(4, 1, outliers=0.0)
    shrunk = rms_offset(pixel_polynomial.fit(samples, LABELS, *DEGREES), head, held_out)
    order = np.lexsort((samples.true, samples.row * WIDTH + samples.column))
    x, e = (part[order].reshape(HEIGHT * WIDTH, -1) for part in (samples.true, samples.residual))
    slope = np.sum((x - 1.65) * e, axis=1) / np.sum((x - 1.65) ** 2, axis=1)
    mine = held_out.row * WIDTH + held_out.column
    own = e.mean(axis=1)[mine] + slope[mine] * (held_out.true - 1.65)
    assert shrunk < 0.8 * np.sqrt(np.mean((own - head.mean(held_out.true, held_out.pixels)) ** 2))


def test_a_pixel_without_samples_is_like_its_region_and_a_region_without_like_the_image(head):
    samples = head.boards(5, 6)
    blind = (LABELS[samples.pixels] == 0) | ((samples.row == 17) & (samples.column == 23))
    samples = samples.take(~blind)
    image = gaussian_polynomial.fit(samples, *DEGREES)
    region = region_polynomial.fit(samples, LABELS, *DEGREES)
    pixel = pixel_polynomial.fit(samples, LABELS, *DEGREES)
    x, a = np.array([1.0, 2.0]), np.array([3000.0, 1000.0])
    first, last = (np.zeros(2, int), np.zeros(2, int)), (np.full(2, 17), np.full(2, 23))
    np.testing.assert_allclose(region.mean(x, a, first), image.mean(x, a, first), atol=1e-12)
    np.testing.assert_allclose(pixel.mean(x, a, first), image.mean(x, a, first), atol=1e-12)
    np.testing.assert_allclose(pixel.mean(x, a, last), region.mean(x, a, last), atol=1e-12)
    # Deviations come to what pixels have in common, which is less than a region's: that holds its pixels' offsets, too.
    ratio = pixel.deviation(x, a, last) / region.deviation(x, a, last)
    assert ((ratio > 0.5) & (ratio < 1)).all()


def test_pixels_that_are_alike_stay_so():
    """For pixels that differ by chance only, the maps' spread is a fraction of a single pixel's standard error."""
    head = Head(1)
    head.offset[...], head.slope[...], head.factor[...] = 5e-3, 0, 1
    model = pixel_polynomial.fit(head.boards(6, 2), LABELS, *DEGREES)
    x, a, p = np.full(HEIGHT * WIDTH, 1.2), np.full(HEIGHT * WIDTH, 3000.0), tuple(np.indices((HEIGHT, WIDTH)))
    mean = model.mean(x, a, (p[0].ravel(), p[1].ravel()))
    assert mean.mean() == pytest.approx(5e-3, abs=2e-4)
    assert mean.std() < 0.5 * head.sigma(1.2, 3000, (0, 0)) / np.sqrt(30)
    factor = model.sigma[0, 0] / model.sigma[0, 0].mean()
    assert factor.std() < 0.03


def test_a_region_map_of_one_region_is_the_image(head):
    samples = head.boards(7, 2)
    one = region_polynomial.fit(samples, np.zeros((HEIGHT, WIDTH), int), *DEGREES)
    image = gaussian_polynomial.fit(samples, *DEGREES)
    x, a, p = samples.true, samples.amplitude, samples.pixels
    np.testing.assert_allclose(one.mean(x, a, p), image.mean(x, a, p), atol=3e-4)
    np.testing.assert_allclose(one.deviation(x, a, p), image.deviation(x, a, p), rtol=0.05)
