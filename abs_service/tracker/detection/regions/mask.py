"""A mask image, drawn by the user or computed by a segmentation."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.initial_detection import DetectionError

LEAST_PIXELS = 16


@dataclass(frozen=True)
class Settings:
    """TOML keys of the region.

    Attributes:
        file: image of the depth sensor's size; the object is where its alpha channel, or without one its brightness,
            is not zero.
    """

    file: Path

    def build(self) -> "Mask":
        """Loads the mask.

        Raises:
            DetectionError: the file is missing or no image.
        """
        image = cv2.imread(str(self.file), cv2.IMREAD_UNCHANGED)
        if image is None:
            raise DetectionError(f"file = {str(self.file)!r} is missing or no image")
        if image.ndim == 3:
            image = image[..., 3] if image.shape[2] == 4 else image.max(axis=2)
        return Mask(image > 0)


class Mask:
    """The object's pixels in the first depth image."""

    def __init__(self, mask: NDArray[np.bool_]):
        self._mask = mask

    def select(self, points_r: NDArray[np.float64], distance: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Pixels (height, width) of the mask that have a return."""
        if self._mask.shape != distance.shape:
            raise DetectionError(f"the mask is {self._mask.shape[::-1]} pixels, the depth image {distance.shape[::-1]}")
        inside = self._mask & np.isfinite(distance)
        if np.count_nonzero(inside) < LEAST_PIXELS:
            raise DetectionError("the mask holds no surface")
        return inside
