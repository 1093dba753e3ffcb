"""Samples of the simulator's true laws of noise, which are not the tracker's models."""

import numpy as np

from calib.noise.fit.samples import Samples
from drivers.simulated.sensors.active_light import WHITE
from drivers.simulated.sensors.structured_light import StructuredLightNoise
from drivers.simulated.sensors.time_of_flight import LEVELS, RANGE_M, TimeOfFlightNoise

#: A time-of-flight head with a mean offset of its own and one of dark surfaces.
TOF = TimeOfFlightNoise(mu_offset=0.01, mu_amplitude=-8.0)
KINECT = StructuredLightNoise()
DISTANCES, AMPLITUDES = (0.7, 2.6), (600.0, 15_000.0)
#: Lowest and highest distance that an outlier can have [m].
ANYWHERE = (0.1, 5.0)


def grid() -> tuple[np.ndarray, np.ndarray]:
    """Distances and amplitudes (n,) all over the domain."""
    x, a = np.meshgrid(np.linspace(*DISTANCES, 20), np.geomspace(*AMPLITUDES, 20))
    return x.ravel(), a.ravel()


def somewhere(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of n pixels, where the pixel does not matter."""
    return np.zeros(n, np.int64), np.zeros(n, np.int64)


def scattered(generator: np.random.Generator, measured: np.ndarray, outliers: float) -> np.ndarray:
    """Measurements of which a share comes from anywhere."""
    lost = generator.random(measured.shape) < outliers
    return np.where(lost, generator.uniform(*ANYWHERE, measured.shape), measured)


def time_of_flight(seed: int, n: int = 20_000, outliers: float = 0.0, brightest: float = AMPLITUDES[1]) -> Samples:
    """White, grey and dark boards at all distances, seen at all angles; amplitudes and distances as digits."""
    generator = np.random.default_rng(seed)
    x = generator.uniform(*DISTANCES, n)
    reflected = WHITE * generator.choice([0.15, 0.5, 0.9], n) * generator.uniform(0.6, 1, n) / x**2
    a = np.clip(reflected, AMPLITUDES[0], brightest)
    measured = x + TOF.mu(x, a) + TOF.sigma(x, a) * generator.standard_normal(n)
    digits = np.rint(scattered(generator, measured, outliers) * (LEVELS / RANGE_M)) * (RANGE_M / LEVELS)
    amplitude = np.rint(a + TOF.amplitude * generator.standard_normal(n))
    return Samples(digits, x, amplitude, *somewhere(n))


def structured_light(seed: int, n: int = 20_000, outliers: float = 0.0, floor: float = 0.0) -> Samples:
    """A board at all distances, straight ahead; the inverse distance comes in steps. `floor` is the board's relief."""
    generator = np.random.default_rng(seed)
    x = generator.uniform(0.6, 3.5, n)
    z = x + floor * generator.standard_normal(n)
    steps = np.rint((1 / z + KINECT.random * generator.standard_normal(n)) / KINECT.step)
    measured = scattered(generator, 1 / (np.maximum(steps, 1) * KINECT.step), outliers)
    return Samples(measured, x, np.full(n, np.nan), *somewhere(n))


def structured_light_deviation(x: np.ndarray) -> np.ndarray:
    """Deviation of random error and steps together [m]."""
    return x**2 * np.sqrt(KINECT.random**2 + KINECT.step**2 / 12)
