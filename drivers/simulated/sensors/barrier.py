"""Light barrier: a binary sensor with a lamp and a receiver."""

from dataclasses import dataclass

import numpy as np

from calib.camera import Camera
from drivers.contract.frame import Frame, Kind
from drivers.simulated.scene.scene import Moment
from drivers.simulated.sensors.exposure import Exposure, stream_of


@dataclass(frozen=True)
class BarrierNoise:
    """Error rates of the receiver, independent in every exposure.

    Attributes:
        miss: probability that an interrupted beam is reported as free.
        false_alarm: probability that a free beam is reported as interrupted.
    """

    miss: float = 0.01
    false_alarm: float = 0.01


class Barrier:
    """Stream `binary` (mono8, one pixel): 255 where the beam is interrupted, 0 where it is free.

    The beam begins at the sensor's origin and ends `length_m` along its z axis. A camera model has no length, so the
    sensor's noise model carries it for the synthesis.

    Attributes:
        length_m: from the lamp to the receiver [m].
    """

    def __init__(
        self, name: str, camera: Camera, length_m: float, rate_hz: float, noise: BarrierNoise = BarrierNoise()
    ) -> None:
        self.camera = camera
        self.length_m = length_m
        self.noise = noise
        self.streams = (stream_of(name, "binary", Kind.BINARY, "mono8", camera, rate_hz),)

    def interrupted(self, moment: Moment) -> bool:
        """True if a body is in the beam."""
        receiver_r = self.camera.center + self.length_m * self.camera.T_rs[:3, 2]
        return bool(moment.hidden(receiver_r[None, None], self.camera.center)[0, 0])

    def expose(self, exposure: Exposure) -> list[Frame]:
        """Takes the state of the beam in one exposure."""
        interrupted = self.interrupted(exposure.moment)
        wrong = self.noise.miss if interrupted else self.noise.false_alarm
        reported = interrupted != (exposure.generator.random() < wrong)
        data = np.full((1, 1), 255 * reported, np.uint8)
        return [exposure.frame(self.streams[0], self.camera, data, scale=1 / 255)]
