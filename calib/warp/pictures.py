"""Images of another camera in a depth sensor's view, where the camera sees its points."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.warp.mesh import MAX_STEP_M, MeshWarp

#: Depth difference beyond which a point is occluded [m].
HIDING_M = 0.02


class PictureLookup:
    """Maps a camera's images into a view by means of the view's distances."""

    def __init__(self, view: Camera, camera: Camera, maximum_step_m: float = MAX_STEP_M, hiding_m: float = HIDING_M):
        self._warp = MeshWarp(view, camera, maximum_step_m)
        self._ray_length = camera.lookup.ray_length
        self._hiding_m = hiding_m

    def look(self, distance: NDArray[np.floating]) -> "Correspondence":
        """Positions of the view's points, given by radial distances (height, width) [m], in the camera's image.

        A point is occluded if the surface spanned by all points is nearer to the camera there.

        Raises:
            WarpError: the camera sees none of them; names the cause.
        """
        warped = self._warp.warp(distance)
        height, width = warped.distance.shape
        place = warped.points.place.astype(np.float64)
        pixel = np.floor(place + 0.5).astype(np.int64)
        inside = np.isfinite(warped.points.inverse_z) & np.all((pixel >= 0) & (pixel < (width, height)), axis=-1)
        pixel[~inside] = 0
        column, row = pixel[..., 0], pixel[..., 1]
        front = np.where(np.isnan(warped.distance), np.float32(np.inf), warped.distance)
        # The rendered surface ends at its outermost pixel centres, so points beside a depth edge are checked
        # separately.
        around = np.asarray(cv2.erode(front, np.ones((3, 3), np.uint8)), np.float32)
        nearest = np.minimum(front + self._hiding_m, around + max(self._hiding_m, self._warp.maximum_step_m))
        with np.errstate(invalid="ignore"):
            visible = inside & (self._ray_length[row, column] / warped.points.inverse_z < nearest[row, column])
        return Correspondence(place, visible)


@dataclass(frozen=True, slots=True, eq=False)
class Correspondence:
    """Correspondence of the points of a view with a camera's image.

    Attributes:
        place: pixel coordinates in the camera's image (height, width, 2) [px]; undefined where not visible.
        visible: True where the camera sees the point (height, width).
    """

    place: NDArray[np.float64]
    visible: NDArray[np.bool_]

    def nearest(self, picture: NDArray[np.generic]) -> NDArray[np.float32]:
        """Image (h, w, channels) in the view by nearest neighbour, NaN where not visible."""
        column, row = np.floor(self.place[self.visible] + 0.5).astype(np.int64).T
        result = np.full((*self.visible.shape, picture.shape[2]), np.nan, np.float32)
        result[self.visible] = picture[row, column]
        return result

    def blended(self, picture: NDArray[np.generic]) -> NDArray[np.float32]:
        """Picture sampled bilinearly, see `nearest`; the outermost half pixel is extrapolated."""
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
