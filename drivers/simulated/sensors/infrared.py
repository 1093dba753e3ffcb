"""Infra-red head with active illumination."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from drivers.contract.frame import Frame, Kind
from drivers.simulated.scene.scene import Scene
from drivers.simulated.sensors.active_light import returned
from drivers.simulated.sensors.exposure import Exposure, stream_of
from drivers.simulated.sensors.view import View

#: Standard deviation of a pixel, in the unit of `active_light.WHITE`.
SIGMA = 50.0


class Infrared:
    """Stream `ir` (mono16): returned intensity of the sensor's own light, like the time-of-flight head's amplitude."""

    def __init__(self, name: str, camera: Camera, scene: Scene, rate_hz: float, sigma: float = SIGMA) -> None:
        self.camera = camera
        self.streams = (stream_of(name, "ir", Kind.IR, "mono16", camera, rate_hz),)
        self._sigma = sigma
        self._view = View(scene, camera)

    @cached_property
    def _wall(self) -> NDArray[np.float32]:
        return np.nan_to_num(returned(self._view.wall))

    def expose(self, exposure: Exposure) -> list[Frame]:
        """Takes the infra-red image of one exposure, antialiased at rims."""
        levels = self._wall.copy()
        for sight in self._view.look(exposure.moment):
            levels[sight.region] += sight.share * (np.nan_to_num(returned(sight)) - levels[sight.region])
        levels += np.float32(self._sigma) * exposure.generator.standard_normal(levels.shape, np.float32)
        pixels = np.clip(np.rint(levels), 0, 65535).astype("<u2")
        return [exposure.frame(self.streams[0], self.camera, pixels)]
