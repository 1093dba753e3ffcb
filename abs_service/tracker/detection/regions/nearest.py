"""The nearest connected surface."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from abs_service.tracker.detection.depth_segments import connected_surfaces
from abs_service.tracker.detection.initial_detection import DetectionError


@dataclass(frozen=True)
class Settings:
    """TOML keys of the region.

    Attributes:
        largest_step_m: largest difference in distance between neighbouring pixels of one surface [m].
        least_pixels: minimum number of pixels of a surface; smaller ones are ignored as noise.
    """

    largest_step_m: Annotated[float, Gt(0)] = 0.04
    least_pixels: Annotated[int, Ge(16)] = 200

    def build(self) -> "Settings":
        """The region itself: its TOML keys are its fields."""
        return self

    def select(self, points_r: NDArray[np.float64], distance: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Pixels (height, width) of the connected surface whose median distance is smallest."""
        labels, count = connected_surfaces(distance, self.largest_step_m)
        sizes = np.bincount(labels.ravel(), minlength=count)
        candidates = [label for label in range(1, count) if sizes[label] >= self.least_pixels]
        if not candidates:
            raise DetectionError(f"no connected surface of at least least_pixels = {self.least_pixels} pixels in sight")
        nearest = min(candidates, key=lambda label: float(np.median(distance[labels == label])))
        return labels == nearest
