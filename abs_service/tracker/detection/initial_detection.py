"""The segmented first depth image of the object, from which mesh and model are built."""

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera


class DetectionError(ValueError):
    """The object is not in view, or too little of it is visible to track it."""


class UndecidedError(DetectionError):
    """Object that can only be located with more images."""


@dataclass(frozen=True, slots=True, eq=False)
class InitialDetection:
    """One depth image, segmented.

    Attributes:
        distance: radial distances (height, width) [m] without mean offset, NaN outside the object.
        camera: the camera that measured them.
        vertices: approximate number of vertices of the mesh to be built.
        surroundings: the same image without segmentation; empty if unknown.
        deviation: standard deviation of a distance of the object, median [m]; 0 if unknown. By the sensor's noise
            model, unless the image scatters much more.
        noise_scale: the deviation over that by the noise model.
        fitting_scale: factor by which distances would have to be multiplied to scatter as the noise model says, if they
            scatter otherwise and one of 0.1 and 10 is such a factor; else 1.
    """

    distance: NDArray[np.float32]
    camera: Camera
    vertices: int
    surroundings: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 0), np.float32))
    deviation: float = 0.0
    noise_scale: float = 1.0
    fitting_scale: float = 1.0

    @property
    def points(self) -> NDArray[np.float64]:
        """Rig coordinates (k, 3) [m] of the object's pixels, in row-major order."""
        points = self.camera.unproject(self.distance).reshape(-1, 3)
        return points[np.isfinite(points[:, 0])]

    def beside(self, reach_px: int) -> NDArray[np.float64]:
        """Rig coordinates (k, 3) [m] of the pixels outside the object that lie at most `reach_px` beside it.

        Segmentation is conservative: it often excludes the object's own pixels at its rim.
        """
        if not self.surroundings.size:
            return np.zeros((0, 3))
        inside = np.isfinite(self.distance).astype(np.uint8)
        near = cv2.dilate(inside, np.ones((2 * reach_px + 1, 2 * reach_px + 1))) > inside
        points = self.camera.unproject(np.where(near, self.surroundings, np.nan).astype(np.float32)).reshape(-1, 3)
        return points[np.isfinite(points[:, 0])]
