"""Pictures in a depth sensor's view: what its points look like to another camera, where that sees them."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.warp.mesh import LARGEST_STEP_M, MeshWarp

#: A camera sees what is nearest to it; a point farther away by more than this is hidden from it [m].
HIDING_M = 0.02


class PictureLookup:
    """Looks up, through the distances of one view, what a camera's picture shows of the same points."""

    def __init__(
        self, view: Camera, camera: Camera, largest_step_m: float = LARGEST_STEP_M, hiding_m: float = HIDING_M
    ):
        self._warp = MeshWarp(view, camera, largest_step_m)
        self._ray_length = camera.lookup.ray_length
        self._hiding_m = hiding_m

    def look(self, distance: NDArray[np.floating]) -> "Sight":
        """Where the camera sees the points of the view's radial distances (height, width) [m].

        A point is hidden if the surface that all of them span is nearer to the camera there.

        Raises:
            WarpError: the camera sees none of them; says why.
        """
        warped = self._warp.warp(distance)
        height, width = warped.distance.shape
        place = warped.points.place.astype(np.float64)
        pixel = np.floor(place + 0.5).astype(np.int64)
        inside = np.isfinite(warped.points.inverse_z) & np.all((pixel >= 0) & (pixel < (width, height)), axis=-1)
        pixel[~inside] = 0
        column, row = pixel[..., 0], pixel[..., 1]
        front = np.where(np.isnan(warped.distance), np.float32(np.inf), warped.distance)
        # A surface is rendered up to its outermost pixels' centres only; it hides what is beside that by a jump, too.
        around = np.asarray(cv2.erode(front, np.ones((3, 3), np.uint8)), np.float32)
        nearest = np.minimum(front + self._hiding_m, around + max(self._hiding_m, self._warp.largest_step_m))
        with np.errstate(invalid="ignore"):
            visible = inside & (self._ray_length[row, column] / warped.points.inverse_z < nearest[row, column])
        return Sight(place, visible)


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """Where a camera sees the points of a view.

    Attributes:
        place: pixel coordinates in the camera's picture (height, width, 2) [px]; mean nothing where it is not visible.
        visible: whether the camera sees the point (height, width).
    """

    place: NDArray[np.float64]
    visible: NDArray[np.bool_]

    def nearest(self, picture: NDArray[np.generic]) -> NDArray[np.float32]:
        """A picture (h, w, channels) in the view, each pixel as it is, NaN where the camera does not see the point."""
        column, row = np.floor(self.place[self.visible] + 0.5).astype(np.int64).T
        result = np.full((*self.visible.shape, picture.shape[2]), np.nan, np.float32)
        result[self.visible] = picture[row, column]
        return result

    def blended(self, picture: NDArray[np.generic]) -> NDArray[np.float32]:
        """As `nearest`, bilinear between pixels; the outermost half pixel repeats."""
        height, width, _ = picture.shape
        result = np.full((*self.visible.shape, picture.shape[2]), np.nan, np.float32)
        place = np.clip(self.place[self.visible], 0, (width - 1, height - 1))
        corner = np.minimum(place.astype(np.int64), (max(width - 2, 0), max(height - 2, 0)))
        (column, row), (right, down) = corner.T, (place - corner).T[..., None]
        beside, below = np.minimum(column + 1, width - 1), np.minimum(row + 1, height - 1)
        upper = (1 - right) * picture[row, column] + right * picture[row, beside]
        lower = (1 - right) * picture[below, column] + right * picture[below, beside]
        result[self.visible] = (1 - down) * upper + down * lower
        return result
