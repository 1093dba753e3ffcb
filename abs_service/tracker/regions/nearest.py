"""The nearest connected surface."""

from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from abs_service.tracker.sighting import SightingError


@dataclass(frozen=True)
class Settings:
    """TOML keys of the region.

    Attributes:
        largest_step_m: neighbouring pixels whose distances differ by more belong to different surfaces [m].
        least_pixels: smaller surfaces are taken for noise.
    """

    largest_step_m: Annotated[float, Gt(0)] = 0.04
    least_pixels: Annotated[int, Ge(16)] = 200

    def build(self) -> "Settings":
        """The region itself: its TOML keys are its fields."""
        return self

    def select(self, points_r: NDArray[np.float64], distance: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Pixels (height, width) of the connected surface whose median distance is smallest."""
        labels, count = _connected_surfaces(distance, self.largest_step_m)
        sizes = np.bincount(labels.ravel(), minlength=count)
        candidates = [label for label in range(1, count) if sizes[label] >= self.least_pixels]
        if not candidates:
            raise SightingError(f"no connected surface of at least least_pixels = {self.least_pixels} pixels in sight")
        nearest = min(candidates, key=lambda label: float(np.median(distance[labels == label])))
        return labels == nearest


def _connected_surfaces(distance: NDArray[np.float32], largest_step: float) -> tuple[NDArray[np.int32], int]:
    """Label of every pixel's surface, 0 for none, and the number of labels.

    Surfaces are separated where the distance jumps; noise is smoothed first, because one noisy pixel would
    otherwise connect or cut.
    """
    filled = np.where(np.isfinite(distance), distance, 0).astype(np.float32)
    smooth = cv2.medianBlur(filled, 5)
    highest = cv2.dilate(smooth, np.ones((3, 3)))
    lowest = cv2.erode(smooth, np.ones((3, 3)))
    surface = (np.isfinite(distance) & (lowest > 0) & (highest - lowest < largest_step)).astype(np.uint8)
    count, labels = cv2.connectedComponents(surface, connectivity=4)
    return np.asarray(labels, np.int32), count
