"""The nearest connected surface: an object before a background."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from abs_service.tracker.detection.depth_segments import large_surfaces
from abs_service.tracker.detection.depth_view import DepthView
from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.detection.within import Restricted, restricted

#: A surface that spans the image is the scene if it has more than this share of the measured pixels, and of all.
SCENE_OF_MEASURED, SCENE_OF_IMAGE = 1 / 2, 1 / 3

#: Share of the width or height at each end that a surface may leave out and still span the image: structured light
#: sensors have no returns in the outer 7 % of an image that is registered to another camera.
SCENE_MARGIN = 0.08


@dataclass(frozen=True)
class Settings:
    """TOML keys of the region.

    Attributes:
        largest_step_m: largest difference in distance between neighbouring pixels of one surface [m].
        least_pixels: minimum number of pixels of a surface; smaller ones are ignored as noise.
        within: mask image as of the region `mask`; pixels outside are ignored.
    """

    largest_step_m: Annotated[float, Gt(0)] = 0.04
    least_pixels: Annotated[int, Ge(16)] = 200
    within: Path | None = None

    def build(self) -> Restricted:
        """The region; DetectionError if `within` is missing or no image."""
        return restricted(self._nearest, self.within)

    def _nearest(self, view: DepthView) -> NDArray[np.bool_]:
        """Pixels (height, width) of the connected surface whose median distance is smallest."""
        labels, large = large_surfaces(view.distance, self.largest_step_m, self.least_pixels)
        nearest = labels == min(large, key=lambda label: float(np.median(view.distance[labels == label])))
        _check_separate(nearest, view.measured)
        return nearest


def _check_separate(surface: NDArray[np.bool_], measured: NDArray[np.bool_]) -> None:
    """Tells an object before a background from a scene in which everything is connected.

    Args:
        surface: pixels (height, width) of the nearest surface.
        measured: pixels (height, width) with a return.

    Raises:
        DetectionError: the surface spans the image and is the larger part of it.
    """
    pixels = np.count_nonzero(surface)
    share = pixels / np.count_nonzero(measured)
    rows, columns = np.nonzero(surface)
    spans = _spans(columns, surface.shape[1]) or _spans(rows, surface.shape[0])
    if spans and share > SCENE_OF_MEASURED and pixels > SCENE_OF_IMAGE * surface.size:
        raise DetectionError(
            f"the nearest connected surface has {share:.0%} of all returns and spans the image: it is the scene, not "
            'an object before a background. If the object is in view, set region.type to "above_plane" where it lies '
            'or stands on something flat, or else to "seed", "box" or "mask"'
        )


def _spans(places: NDArray[np.int64], size: int) -> bool:
    """True if columns or rows (k,) reach from one end of an image of this size to the other."""
    margin = SCENE_MARGIN * size
    return bool(places.min() <= margin and places.max() >= size - 1 - margin)
