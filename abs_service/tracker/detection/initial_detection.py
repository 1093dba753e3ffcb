"""An object as the reference sensor first sees it: what a model is made from."""

from dataclasses import dataclass, field

import cv2
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
        surroundings: the same image with everything around the object; empty if nobody knows.
    """

    distance: NDArray[np.float32]
    camera: Camera
    vertices: int
    surroundings: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 0), np.float32))

    @property
    def points(self) -> NDArray[np.float64]:
        """Rig coordinates (k, 3) [m] of the object's pixels, row by row."""
        points = self.camera.unproject(self.distance).reshape(-1, 3)
        return points[np.isfinite(points[:, 0])]

    def beside(self, reach_px: int) -> NDArray[np.float64]:
        """Rig coordinates (k, 3) [m] of pixels outside the object, at most `reach_px` beside one of its own.

        Which pixels show the object is decided with care, so that those at its rim are often left out.
        """
        if not self.surroundings.size:
            return np.zeros((0, 3))
        inside = np.isfinite(self.distance).astype(np.uint8)
        near = cv2.dilate(inside, np.ones((2 * reach_px + 1, 2 * reach_px + 1))) > inside
        points = self.camera.unproject(np.where(near, self.surroundings, np.nan).astype(np.float32)).reshape(-1, 3)
        return points[np.isfinite(points[:, 0])]
