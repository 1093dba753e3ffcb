"""Input of a region: the first depth image, its points and the camera that measured it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.initial_detection import DetectionError
from calib.camera import Camera


@dataclass(frozen=True, slots=True, eq=False)
class DepthView:
    """One depth image in SI units.

    Attributes:
        points_r: rig coordinates of every pixel (height, width, 3) [m], NaN without return.
        distance: radial distances (height, width) [m], NaN without return.
        camera: the camera that measured them.
    """

    points_r: NDArray[np.float64]
    distance: NDArray[np.float32]
    camera: Camera

    @classmethod
    def of(cls, distance: NDArray[np.float32], camera: Camera) -> "DepthView":
        """The view of radial distances (height, width) [m], NaN without return."""
        return cls(camera.unproject(distance), distance, camera)

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Pixels (height, width) with a return."""
        return np.isfinite(self.distance)


def limited(view: DepthView, within: NDArray[np.bool_]) -> DepthView:
    """The same view without the returns outside a mask (height, width).

    Raises:
        DetectionError: the mask has another size than the image.
    """
    if within.shape != view.distance.shape:
        raise DetectionError(f"the mask is {within.shape[::-1]} pixels, the depth image {view.distance.shape[::-1]}")
    points_r = np.where(within[..., None], view.points_r, np.nan)
    distance = np.where(within, view.distance, np.nan).astype(np.float32, copy=False)
    return DepthView(points_r, distance, view.camera)


def at_points(image: NDArray[np.floating], camera: Camera, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (k,) of an image (height, width) at the pixels that show points (k, 3) [m]; NaN outside the image."""
    place = np.floor(camera.project(points) + 0.5)
    ahead = (points - camera.center) @ camera.T_rs[:3, 2] > 0
    with np.errstate(invalid="ignore"):
        inside = ahead & np.all((place >= 0) & (place < (camera.width, camera.height)), axis=1)
    values = np.full(len(points), np.nan)
    column, row = place[inside].astype(np.intp).T
    values[inside] = image[row, column]
    return values
