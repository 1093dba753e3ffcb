"""A mask image, drawn by the user or computed by a segmentation."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.depth_view import DepthView, limited
from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.detection.segments.within import load_mask

MIN_PIXELS = 16


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
        return Mask(load_mask(self.file, "file"))


class Mask:
    """The object's pixels in the first depth image."""

    def __init__(self, mask: NDArray[np.bool_]):
        self._mask = mask

    def select(self, view: DepthView) -> NDArray[np.bool_]:
        """Pixels (height, width) of the mask that have a return.

        Raises:
            DetectionError: the mask has another size than the image, or no return.
        """
        inside = limited(view, self._mask).measured
        if np.count_nonzero(inside) < MIN_PIXELS:
            raise DetectionError("the mask holds no surface")
        return inside
