"""The nearest connected surface: an object before a background."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.depth_view import DepthView
from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.detection.plausibility import is_scene
from abs_service.tracker.detection.segments.depth_segments import large_surfaces
from abs_service.tracker.detection.segments.surface_settings import SurfaceSettings
from abs_service.tracker.detection.segments.within import Restricted, restricted

#: Largest width of a gap of missing returns that tears a piece off the scene [px].
TORN_PX = 5


@dataclass(frozen=True)
class Settings(SurfaceSettings):
    """TOML keys of the region."""

    def build(self) -> Restricted:
        """The region; DetectionError if `within` is missing or no image."""
        return restricted(self._nearest, self.within, self.polygon)

    def _nearest(self, view: DepthView) -> NDArray[np.bool_]:
        """Pixels (height, width) of the connected surface whose median distance is smallest.

        Raises:
            DetectionError: there is none, or it is a scene in which everything is connected, or a piece of that.
        """
        step = view.step(self.maximum_step_m)
        labels, large = large_surfaces(view.distance, step, self.minimum_pixels)
        nearest = labels == min(large, key=lambda label: float(np.median(view.distance[labels == label])))
        largest = labels == large[0]
        if is_scene(largest, view.measured) and _goes_on(nearest, largest, view.distance, step):
            nearest = largest
        if is_scene(nearest, view.measured):
            share = np.count_nonzero(nearest) / np.count_nonzero(view.measured)
            raise DetectionError(
                f"the nearest connected surface has {share:.0%} of all returns and spans the image: it is the scene, "
                'not an object before a background. If the object is in view, set region.type to "above_plane" where '
                'it lies or stands on something flat, or else to "seed", "box" or "mask"'
            )
        return nearest


def _goes_on(
    piece: NDArray[np.bool_],
    surface: NDArray[np.bool_],
    distance: NDArray[np.float32],
    maximum_step: NDArray[np.float32] | float,
) -> bool:
    """True if a surface (height, width) is about as far away as a piece of it, where it begins beside the piece."""
    around = np.ones((2 * TORN_PX + 1, 2 * TORN_PX + 1))
    farthest = cv2.dilate(np.where(piece, distance, 0), around)
    nearest = cv2.erode(np.where(piece, distance, np.float32(np.inf)), around)
    beside = surface & (farthest > 0)
    with np.errstate(invalid="ignore"):
        alike = (distance > nearest - maximum_step) & (distance < farthest + maximum_step)
    return bool(np.count_nonzero(beside & alike) > np.count_nonzero(beside) / 2)
