"""An object as the reference sensor first sees it: what a model is made from."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera


class SightingError(ValueError):
    """An object that is not in sight, or of which there is too little to track."""


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """One depth image of the object alone.

    Attributes:
        distance: radial distances (height, width) [m] without mean offset, NaN outside the object.
        camera: the camera that measured them.
        vertices: about how many vertices the mesh is to have.
    """

    distance: NDArray[np.float32]
    camera: Camera
    vertices: int

    @property
    def points(self) -> NDArray[np.float64]:
        """Rig coordinates (k, 3) [m] of the object's pixels, row by row."""
        points = self.camera.unproject(self.distance).reshape(-1, 3)
        return points[np.isfinite(points[:, 0])]
