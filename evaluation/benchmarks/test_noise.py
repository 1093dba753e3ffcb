"""Time to render the noise texture of one frame, the same for every model, and to fit a model.

Compare minima of one run with each other; machines, and hours on one machine, differ.
"""

import numpy as np
import pytest

from calib.noise import gaussian_polynomial, pixel_polynomial, tof_amplitude
from calib.noise.base import DepthNoise
from calib.noise.constant import Constant
from calib.noise.gaussian_polynomial import GaussianPolynomial
from calib.noise.pixel_polynomial import PixelPolynomial
from calib.noise.region_polynomial import RegionPolynomial, blocks
from calib.noise.structured_light import StructuredLight
from calib.noise.tof_amplitude import TofAmplitude
from drivers.simulated.sensors.time_of_flight import SIGMA_POLYNOMIAL
from evaluation.calibration import noise_laws
from tests.calib.noise.test_shrinkage import DEGREES, HEIGHT, LABELS, WIDTH, Head
from tests.calib.noise.texels import render_texture

SIZES = {"176x144": (144, 176), "640x480": (480, 640)}
SIGMA, MU = np.array(SIGMA_POLYNOMIAL), np.array([[0.01, -1e-6], [-2e-3, 0.0]])
DOMAIN = np.array([0.1, 5.0]), np.array([400.0, 10_000.0])


def models(height: int, width: int) -> dict[str, DepthNoise]:
    """One of every type, as it would be used: polynomials of degree 1 in the distance and 3 in the amplitude."""
    labels = blocks(height, width, 16)
    regions = int(labels.max()) + 1
    of_pixels = [np.tile(table[..., None, None], (1, 1, height, width)) for table in (SIGMA, MU)]
    of_regions = [np.tile(table[..., None], (1, 1, regions)) for table in (SIGMA, MU)]
    return {
        "constant": Constant(5e-3, 0.01),
        "structured_light": StructuredLight(),
        "tof_amplitude": TofAmplitude((0.0015, 0.0005), 9.0, (0.01, -2e-3), -8.0),
        "gaussian_polynomial": GaussianPolynomial(SIGMA_POLYNOMIAL, tuple(map(tuple, MU.tolist()))),
        "region_polynomial": RegionPolynomial(labels, of_regions[0], of_regions[1], *DOMAIN),
        "pixel_polynomial": PixelPolynomial(of_pixels[0], of_pixels[1], *DOMAIN),
    }


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", models(1, 1))
def test_render(benchmark, name, size):
    shape = SIZES[size]
    generator = np.random.default_rng(1)
    distance = generator.uniform(0.8, 1.6, shape).astype(np.float32)
    amplitude = generator.uniform(500, 9000, shape).astype(np.float32)
    model = models(*shape)[name]
    texture = benchmark(render_texture, model, distance, amplitude, 1.6)
    assert (texture[1:-1, 1:-1, 3] > 0).all()


FITS = {
    "tof_amplitude": tof_amplitude.fit,
    "gaussian_polynomial": lambda samples: gaussian_polynomial.fit(samples, (1, 3), (1, 3)),
}


@pytest.mark.parametrize("name", FITS)
def test_fit_20000_samples(benchmark, name):
    samples = noise_laws.time_of_flight(1, outliers=0.05)
    assert benchmark.pedantic(FITS[name], (samples,), rounds=1 if benchmark.disabled else 5).uses_amplitude


def test_fit_pixels_of_ten_frames(benchmark):
    samples = Head(1).boards(1, 10)
    rounds = 1 if benchmark.disabled else 3
    model = benchmark.pedantic(lambda: pixel_polynomial.fit(samples, LABELS, *DEGREES), rounds=rounds)
    assert model.shape == (HEIGHT, WIDTH)
