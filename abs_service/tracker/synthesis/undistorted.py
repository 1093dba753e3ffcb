"""Sparse synthesis on backward-undistorted input: images are resampled once, vertices use a pinhole projection."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Window
from abs_service.pairing.observation import Observation
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.base import View
from abs_service.tracker.synthesis.sparse import SparseView
from abs_service.tracker.synthesis.window import WHOLE
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
    """Resamples images by precomputed nearest-neighbour tables, so that no two measurements are mixed."""

    resamples = True

    def __init__(self, rig: Rig, mesh: Mesh):
        self.canvas = mesh
        self._pinholes: dict[str, Camera] = {name: pinhole_of(sensor.camera) for name, sensor in rig.sensors.items()}
        self._tables = {name: resampling(self._pinholes[name], sensor.camera) for name, sensor in rig.sensors.items()}

    def observe(self, observation: Observation) -> "Undistorted":
        """Itself: the tables depend on the lenses only."""
        return self

    def view(self, sensor: str, attributes: NDArray[np.float32]) -> View:
        """View of the vertices with attributes (n, channels) in one sensor's camera without distortion."""
        return SparseView(self._pinholes[sensor], self.canvas.faces, attributes)

    def window(self, sensor: str, predicted: Surface, reach_m: float) -> Window:
        """The whole image: images are resampled completely."""
        return WHOLE

    def texture(self, sensor: str, texture: NDArray[np.float32]) -> NDArray[np.float32]:
        """The noise texture (height + 2, width + 2, 8), resampled; radial distances stay, as the centre is the same."""
        return texture.reshape(-1, 8)[self._tables[sensor]]

    def image(self, sensor: str, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """An image (height, width, channels), resampled; NaN outside the sensor's field of view."""
        bordered = np.pad(image, ((1, 1), (1, 1), (0, 0)), constant_values=np.nan)
        return bordered.reshape(-1, image.shape[2])[self._tables[sensor][1:-1, 1:-1]]
