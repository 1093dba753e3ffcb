"""Makes heads from their names and settings."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from calib.camera import Camera
from calib.lenses.lens import Lens, LensModel
from drivers.simulated.scene.scene import Scene
from drivers.simulated.sensors import infrared
from drivers.simulated.sensors.barrier import Barrier, BarrierNoise
from drivers.simulated.sensors.bayer import Bayer, Mosaic
from drivers.simulated.sensors.color import SIGMA, Color, Picture
from drivers.simulated.sensors.exposure import Head
from drivers.simulated.sensors.infrared import Infrared
from drivers.simulated.sensors.optics import BEAMS, OPTICS
from drivers.simulated.sensors.structured_light import StructuredLight, StructuredLightNoise
from drivers.simulated.sensors.time_of_flight import TimeOfFlight, TimeOfFlightNoise


@dataclass(frozen=True)
class HeadFactory:
    """Settings of the heads, and the factory that makes them.

    Attributes:
        sizes: image sizes [px] of heads that differ from the default.
        rate_hz: exposures per second.
        noise: factor on all random errors.
        offset, wiggle, dark, pattern: offsets of the time-of-flight head; see `Address`.
        lens: distortion of all imaging heads.
        mosaic: of the Bayer head.
        samples, blur_px: rays per pixel and axis, and blur of the lens, of the colour and Bayer heads; see `Picture`.
    """

    sizes: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    rate_hz: float = 30.0
    noise: float = 1.0
    offset: float = 0.0
    wiggle: float = 0.0
    dark: float = 0.0
    pattern: float = 0.0
    lens: LensModel = field(default_factory=Lens)
    mosaic: Mosaic = field(default_factory=Mosaic)
    samples: int = 1
    blur_px: float = 0.0

    def head(self, name: str, scene: Scene) -> Head:
        """The head with a name in `OPTICS` or `BEAMS`, observing a scene.

        Raises:
            LensError: the distortion is not invertible in the image.
        """
        if name in BEAMS:
            beam, noise = BEAMS[name], BarrierNoise()
            wrong = BarrierNoise(self.noise * noise.miss, self.noise * noise.false_alarm)
            return Barrier(name, beam.camera, beam.length_m, self.rate_hz, wrong)
        optics = OPTICS[name]
        camera = optics.camera(*self.sizes.get(name, (optics.width, optics.height)), self.lens)
        match name:
            case "tof":
                return TimeOfFlight(name, camera, scene, self.rate_hz, self._time_of_flight_noise())
            case "structured_light":
                random = self.noise * StructuredLightNoise.random
                return StructuredLight(name, camera, scene, self.rate_hz, StructuredLightNoise(random=random))
            case "ir":
                return Infrared(name, camera, scene, self.rate_hz, self.noise * infrared.SIGMA)
            case "bayer":
                return Bayer(name, self._picture(camera, scene), self.rate_hz, self.noise * SIGMA, self.mosaic)
            case _:
                return Color(name, self._picture(camera, scene), self.rate_hz, self.noise * SIGMA)

    def _picture(self, camera: Camera, scene: Scene) -> Picture:
        return Picture(camera, scene, self.samples, self.blur_px)

    def _time_of_flight_noise(self) -> TimeOfFlightNoise:
        default = TimeOfFlightNoise()
        return replace(
            default,
            mu_offset=self.offset,
            mu_wiggle=self.wiggle,
            mu_amplitude=self.dark,
            pattern=self.pattern,
            sigma_offset=self.noise * default.sigma_offset,
            sigma_distance=self.noise * default.sigma_distance,
            sigma_amplitude=self.noise * default.sigma_amplitude,
            amplitude=self.noise * default.amplitude,
        )
