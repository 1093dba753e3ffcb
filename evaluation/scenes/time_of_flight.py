"""A time-of-flight camera with noise: a σ per pixel that grows with falling amplitude."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from drivers.contract.frame import Frame, FrameSet, Geometry, Kind
from evaluation.scenes.rendering import View

#: Unambiguous range [m] of a SwissRanger SR4000 at 30 MHz, and the steps that it is digitised in.
RANGE_M, LEVELS = 5.0, 2**14

#: An SR4000 without a lens's distortion: 176 × 144 pixels, 43.6° × 36.2°.
SR4000 = Camera(176, 144, 220.0, 220.0, 87.5, 71.5)

#: Amplitude of a white surface that faces the sensor at a distance of 1 m.
WHITE = 10_000.0


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """Measured images.

    Attributes:
        distance: radial distances (height, width) [m] in whole steps; NaN without return.
        amplitude: (height, width) in whole numbers.
    """

    distance: NDArray[np.float32]
    amplitude: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class TimeOfFlight:
    """The true law of the errors: a pixel p measures x + μ_p(x, a) + σ_p(x, a) · N(0, 1).

    σ_p(x, a) = factor_p · (sigma_offset + sigma_distance · x + sigma_amplitude / a) and
    μ_p(x, a) = pattern_p + mu_offset + mu_amplitude / a, with x the real distance and a the amplitude without noise.
    With the defaults, σ of a factor of 1 is 2 mm on white at 0.75 m and 40 mm on something dark (0.17) at 2.65 m, which
    is the range of the paper's figure 8.

    Attributes:
        factor: of every pixel's deviation (height, width), or one for all ().
        sigma_offset: deviation of the brightest, closest return [m].
        sigma_distance: growth of the deviation with the distance.
        sigma_amplitude: deviation times amplitude [m].
        pattern: every pixel's own mean offset (height, width) [m], or one for all ().
        mu_offset: mean offset [m].
        mu_amplitude: mean offset times amplitude [m]: what is dark looks farther away, or nearer if negative.
        amplitude_deviation: deviation of the amplitude.
        minimum_amplitude: a weaker return is reported as none.
        illumination: share of the lamp's light that goes where each pixel looks (height, width), or one for all ().
    """

    factor: NDArray[np.float64] = field(default_factory=lambda: np.ones(()))
    sigma_offset: float = 0.0015
    sigma_distance: float = 0.0
    sigma_amplitude: float = 9.0
    pattern: NDArray[np.float64] = field(default_factory=lambda: np.zeros(()))
    mu_offset: float = 0.0
    mu_amplitude: float = 0.0
    amplitude_deviation: float = 25.0
    minimum_amplitude: float = 100.0
    illumination: NDArray[np.float64] = field(default_factory=lambda: np.ones(()))

    def amplitude(self, view: View) -> NDArray[np.float64]:
        """Amplitudes (height, width) without noise."""
        return WHITE * self.illumination * view.light

    def deviation(self, x: NDArray[np.floating], a: NDArray[np.floating]) -> NDArray[np.float64]:
        """σ [m] of every pixel (height, width) at its distance [m] and amplitude."""
        with np.errstate(divide="ignore"):
            return self.factor * (self.sigma_offset + self.sigma_distance * x + self.sigma_amplitude / a)

    def mean(self, x: NDArray[np.floating], a: NDArray[np.floating]) -> NDArray[np.float64]:
        """μ [m] of every pixel (height, width) at its distance [m] and amplitude."""
        with np.errstate(divide="ignore"):
            return self.pattern + self.mu_offset + self.mu_amplitude / a

    def measure(self, view: View, generator: np.random.Generator, exposures: int = 1) -> Measurement:
        """Takes an exposure, or the mean of several of the same view."""
        amplitude = self.amplitude(view)
        normal = generator.standard_normal((2, *amplitude.shape)) / np.sqrt(exposures)
        with np.errstate(invalid="ignore"):
            distance = view.distance + self.mean(view.distance, amplitude)
            distance = distance + self.deviation(view.distance, amplitude) * normal[0]
            bright = amplitude + self.amplitude_deviation * normal[1]
            good = (bright >= self.minimum_amplitude) & (distance > 0) & (distance < RANGE_M)
        step = RANGE_M / LEVELS
        steps = np.rint(np.where(good, distance, np.nan) / step)
        return Measurement((steps * step).astype(np.float32), np.clip(np.rint(bright), 0, 65535).astype(np.float32))


def frame_set(measured: Measurement, seq: int, t_ns: int) -> FrameSet:
    """A measurement as the frames `depth` (radial) and `amplitude` that a driver would deliver."""
    frames = [
        Frame(
            "tof", kind.value, kind, np.nan_to_num(values).astype("<f4"), "32FC1", t_ns, t_ns, seq,
            geometry=geometry, invalid=invalid,
        )
        for kind, values, geometry, invalid in (
            (Kind.DEPTH, measured.distance, Geometry.RADIAL, 0.0),
            (Kind.AMPLITUDE, measured.amplitude, Geometry.NONE, None),
        )
    ]  # fmt: skip
    return FrameSet(seq, t_ns, {frame.key: frame for frame in frames})
