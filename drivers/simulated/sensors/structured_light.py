"""Structured-light head: z-depth with random error and quantisation steps that grow with the squared distance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.simulated.scene.scene import Scene
from drivers.simulated.sensors.exposure import Exposure, stream_of
from drivers.simulated.sensors.view import View


@dataclass(frozen=True)
class StructuredLightNoise:
    """Errors of the disparity, in units of inverse depth.

    Attributes:
        random: σ of the inverse depth [1/m]; the σ of the depth is random · z² (Khoshelham and Elberink,
            Sensors 2012, for a Kinect v1).
        step: quantisation step of the inverse depth [1/m].
        minimum_cosine: minimum cosine of incidence for a return.
    """

    random: float = 1.425e-3
    step: float = 2.85e-3
    minimum_cosine: float = 0.2


class StructuredLight:
    """Stream `depth` (z in mm, 16UC1, 0 without return).

    No return where a rim crosses a pixel, in shadows of the projector, and from surfaces at grazing incidence. The
    wall always returns.

    Attributes:
        PROJECTOR_S: position of the projector in the sensor frame [m]; the baseline is that of a Kinect v1.
    """

    PROJECTOR_S = (0.075, 0.0, 0.0)

    def __init__(
        self,
        name: str,
        camera: Camera,
        scene: Scene,
        rate_hz: float,
        noise: StructuredLightNoise = StructuredLightNoise(),
    ) -> None:
        self.camera = camera
        self.noise = noise
        self.streams = (stream_of(name, "depth", Kind.DEPTH, "16UC1", camera, rate_hz),)
        self._view = View(scene, camera)

    def expose(self, exposure: Exposure) -> list[Frame]:
        """Takes the depth of one exposure."""
        sights = self._view.look(exposure.moment)
        distance = self._view.wall.distance.copy()
        lost = np.zeros(distance.shape, np.bool_)
        for sight in sights:
            full = sight.share == 1
            distance[sight.region] = np.where(full, sight.distance, distance[sight.region])
            flat = sight.cosine < self.noise.minimum_cosine
            lost[sight.region] = np.where(full, flat, lost[sight.region] | (sight.share > 0))
        lost |= np.isnan(distance)
        for body, sight in zip(exposure.moment.bodies, sights):
            beside = self._beside(sight.region)
            lost[beside] |= self._view.shadow(body, distance[beside], beside, self.PROJECTOR_S)
        depth = np.where(lost, 0, self._digitize(distance * self._view.rays[..., 2], exposure.generator))
        millimetres = np.clip(np.rint(depth * 1000), 0, 65535).astype("<u2")
        return [exposure.frame(self.streams[0], self.camera, millimetres, scale=0.001, geometry=Geometry.Z, invalid=0)]

    def _digitize(self, z: NDArray[np.floating], generator: np.random.Generator) -> NDArray[np.floating]:
        inverse = 1 / z + self.noise.random * generator.standard_normal(z.shape, np.float32)
        steps = np.maximum(np.rint(inverse / self.noise.step), 1)
        return 1 / (steps * self.noise.step)

    def _beside(self, region: tuple[slice, slice]) -> tuple[slice, slice]:
        """The region, extended to the left by the maximum width of the body's shadow.

        Worst case: a body at half a metre in front of a point at infinity.
        """
        rows, columns = region
        width = int(np.ceil(self.PROJECTOR_S[0] * self.camera.fx / 0.5))
        return rows, slice(max(columns.start - width, 0), columns.stop)
