"""Time-of-flight head: radial distance and amplitude, with amplitude-dependent errors."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.simulated.scene.scene import Scene
from drivers.simulated.sensors.active_light import returned
from drivers.simulated.sensors.exposure import Exposure, stream_of
from drivers.simulated.sensors.view import BodyImage, View

#: Unambiguous range [m] and number of quantisation levels: a SwissRanger SR4000 at 30 MHz.
RANGE_M, LEVELS = 5.0, 2**14

#: Period of the wiggling error [m]: a quarter of the unambiguous range, since the third and fifth harmonic cause it.
WIGGLE_M = RANGE_M / 4

#: Seed of the fixed pattern noise.
_MADE = 1

#: Polynomial fit of σ of the default noise: row i is the power i of the distance [m], column j the power j of the
#: amplitude. For amplitudes from 2000 to 10000 its error is below 0.3 mm; below, it is up to a quarter too small.
SIGMA_POLYNOMIAL = ((1.0425e-2, -2.8187e-6, 3.5261e-10, -1.5195e-14), (5.0e-4, 0.0, 0.0, 0.0))


@dataclass(frozen=True)
class TimeOfFlightNoise:
    """True noise model: at distance x [m] and amplitude a, the measurement is x + μ + σ · N(0, 1).

    μ(x, a) = mu_offset + mu_wiggle · sin(2π x / `WIGGLE_M`) + mu_amplitude / a, plus fixed pattern noise, and σ(x, a) =
    sigma_offset + sigma_distance · x + sigma_amplitude / a. With the defaults μ is 0, and σ is 3 to 6.5 mm on the sheet
    and 4 to 25 mm on the wall. `SIGMA_POLYNOMIAL` approximates that σ in the tracker's noise model.

    Attributes:
        mu_offset: mean offset [m].
        mu_wiggle: amplitude of the periodic offset [m] ("wiggling": the modulation is not sinusoidal).
        mu_amplitude: mean offset times amplitude [m].
        pattern: standard deviation of the constant per-pixel offsets [m] (fixed pattern noise).
        sigma_offset: σ of the brightest, closest return [m].
        sigma_distance: growth of σ with the distance.
        sigma_amplitude: σ times amplitude [m].
        amplitude: standard deviation of the measured amplitude.
        minimum_amplitude: minimum amplitude; weaker returns are invalid.
    """

    mu_offset: float = 0.0
    mu_wiggle: float = 0.0
    mu_amplitude: float = 0.0
    pattern: float = 0.0
    sigma_offset: float = 0.0015
    sigma_distance: float = 0.0005
    sigma_amplitude: float = 9.0
    amplitude: float = 25.0
    minimum_amplitude: float = 500.0

    def mu(self, x: NDArray[np.floating], a: NDArray[np.floating]) -> NDArray[np.floating]:
        """Mean offset μ [m], averaged over pixels, at distance `x` [m] and amplitude `a`."""
        return self.mu_offset + self.mu_wiggle * np.sin(2 * np.pi / WIGGLE_M * x) + self.mu_amplitude / a

    def sigma(self, x: NDArray[np.floating], a: NDArray[np.floating]) -> NDArray[np.floating]:
        """Standard deviation σ [m] at distance `x` [m] and amplitude `a`."""
        return self.sigma_offset + self.sigma_distance * x + self.sigma_amplitude / a


class TimeOfFlight:
    """Streams `depth` (radial, 16UC1 in steps of `RANGE_M` / `LEVELS`) and `amplitude` (16UC1).

    The amplitude is the `returned` intensity. A pixel at a rim is the amplitude-weighted mean of body and background,
    which puts its distance between the two ("flying pixel").

    Attributes:
        pattern: fixed pattern noise (height, width) [m]; independent of the scene's seed.
    """

    def __init__(
        self, name: str, camera: Camera, scene: Scene, rate_hz: float, noise: TimeOfFlightNoise = TimeOfFlightNoise()
    ) -> None:
        self.camera = camera
        self.noise = noise
        self.streams = (
            stream_of(name, "depth", Kind.DEPTH, "16UC1", camera, rate_hz),
            stream_of(name, "amplitude", Kind.AMPLITUDE, "16UC1", camera, rate_hz),
        )
        self._view = View(scene, camera)
        normal = np.random.default_rng(_MADE).standard_normal((camera.height, camera.width), np.float32)
        self.pattern = np.float32(noise.pattern) * normal

    @cached_property
    def _wall_amplitude(self) -> NDArray[np.float32]:
        return returned(self._view.wall)

    def expose(self, exposure: Exposure) -> list[Frame]:
        """Takes depth and amplitude of one exposure."""
        distance, amplitude = self.ideal(self._view.look(exposure.moment))
        normal = exposure.generator.standard_normal((2, *distance.shape), np.float32)
        with np.errstate(divide="ignore", invalid="ignore"):
            measured = distance + self.noise.mu(distance, amplitude) + self.pattern
            measured += self.noise.sigma(distance, amplitude) * normal[0]
            brightness = amplitude + self.noise.amplitude * normal[1]
            lost = ~(measured > 0) | ~(brightness >= self.noise.minimum_amplitude)
        depth = np.clip(np.rint(np.where(lost, 0, measured) * (LEVELS / RANGE_M)), 0, LEVELS - 1).astype("<u2")
        levels = np.clip(np.rint(np.nan_to_num(brightness)), 0, 65535).astype("<u2")
        return [
            exposure.frame(
                self.streams[0], self.camera, depth, scale=RANGE_M / LEVELS, geometry=Geometry.RADIAL, invalid=0
            ),
            exposure.frame(self.streams[1], self.camera, levels),
        ]

    def ideal(self, sights: tuple[BodyImage, ...]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Noise-free distance [m] and amplitude (height, width); mixed at rims, NaN for a miss."""
        distance, amplitude = self._view.wall.distance.copy(), self._wall_amplitude.copy()
        for sight in sights:
            body = sight.share * returned(sight)
            behind = (1 - sight.share) * amplitude[sight.region]
            some = sight.share > 0
            with np.errstate(invalid="ignore", divide="ignore"):
                mixed = (body * sight.distance + behind * distance[sight.region]) / (body + behind)
            distance[sight.region] = np.where(some, mixed, distance[sight.region])
            amplitude[sight.region] = np.where(some, body + behind, amplitude[sight.region])
        return distance, amplitude
