"""Heads by their names."""

from dataclasses import replace

from calib.camera import Camera
from calib.lenses.lens import LensModel
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
from drivers.simulated.settings import SHARP, Settings


def make_head(name: str, scene: Scene, settings: Settings, lens: LensModel) -> Head:
    """The head with a name in `OPTICS` or `BEAMS`, observing a scene; all imaging heads have the lens.

    Raises:
        LensError: the distortion is not invertible in the image.
    """
    rate_hz, noise = settings.rate, settings.noise
    if name in BEAMS:
        beam, typical = BEAMS[name], BarrierNoise()
        wrong = BarrierNoise(noise * typical.miss, noise * typical.false_alarm)
        return Barrier(name, beam.camera, beam.length_m, rate_hz, wrong)
    optics = OPTICS[name]
    camera = optics.camera(*settings.sizes.get(name, (optics.width, optics.height)), lens)
    match name:
        case "tof":
            return TimeOfFlight(name, camera, scene, rate_hz, _time_of_flight_noise(settings))
        case "structured_light":
            random = noise * StructuredLightNoise.random
            return StructuredLight(name, camera, scene, rate_hz, StructuredLightNoise(random=random))
        case "ir":
            return Infrared(name, camera, scene, rate_hz, noise * infrared.SIGMA)
        case "bayer":
            mosaic = Mosaic(settings.order, settings.crosstalk)
            return Bayer(name, _picture(camera, scene, settings), rate_hz, noise * SIGMA, mosaic)
        case _:
            return Color(name, _picture(camera, scene, settings), rate_hz, noise * SIGMA)


def _picture(camera: Camera, scene: Scene, settings: Settings) -> Picture:
    samples = 2 if settings.texture == "fine" or settings.scene in SHARP else 1
    return Picture(camera, scene, samples, settings.blur)


def _time_of_flight_noise(settings: Settings) -> TimeOfFlightNoise:
    typical, factor = TimeOfFlightNoise(), settings.noise
    return replace(
        typical,
        mu_offset=settings.offset,
        mu_wiggle=settings.wiggle,
        mu_amplitude=settings.dark,
        pattern=settings.pattern,
        sigma_offset=factor * typical.sigma_offset,
        sigma_distance=factor * typical.sigma_distance,
        sigma_amplitude=factor * typical.sigma_amplitude,
        amplitude=factor * typical.amplitude,
    )
