"""Sparse synthesis on backward-undistorted input: images are resampled once, vertices are projected without lens."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.observation import Observation
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.base import View
from abs_service.tracker.synthesis.sparse import SparseView
from abs_service.tracker.synthesis.window import WHOLE, Window
from calib.camera import Camera
from calib.rig import Rig
from calib.warp.pinhole import pinhole_of, resampling


@dataclass(frozen=True)
class Settings:
    """Synthesis on undistorted input has no keys."""

    def build(self, rig: Rig, mesh: Mesh) -> "Undistorted":
        """The synthesis of a mesh for the sensors of a rig."""
        return Undistorted(rig, mesh)


class Undistorted:
    """Resamples images by tables made once, each pixel to its nearest, so that no measurement is mixed with another.

    Attributes:
        canvas: the mesh.
    """

    def __init__(self, rig: Rig, mesh: Mesh):
        self.canvas = mesh
        self._pinholes: dict[str, Camera] = {name: pinhole_of(sensor.camera) for name, sensor in rig.sensors.items()}
        self._tables = {name: resampling(self._pinholes[name], sensor.camera) for name, sensor in rig.sensors.items()}

    def observe(self, observation: Observation) -> None:
        """Nothing depends on the images: the tables are those of the lenses."""

    def view(self, sensor: str, attributes: NDArray[np.float32]) -> View:
        """The vertices with attributes (n, channels) through one sensor's camera without its distortion."""
        return SparseView(self._pinholes[sensor], self.canvas.faces, attributes)

    def window(self, sensor: str, predicted: Surface, reach_m: float) -> Window:
        """All: the images are resampled as a whole."""
        return WHOLE

    def texture(self, sensor: str, texture: NDArray[np.float32]) -> NDArray[np.float32]:
        """A rendered noise model (height + 2, width + 2, 8), resampled; its distances stay, since the centre does."""
        return texture.reshape(-1, 8)[self._tables[sensor]]

    def image(self, sensor: str, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """An image (height, width, channels), resampled; NaN where the sensor sees nothing."""
        bordered = np.pad(image, ((1, 1), (1, 1), (0, 0)), constant_values=np.nan)
        return bordered.reshape(-1, image.shape[2])[self._tables[sensor][1:-1, 1:-1]]
