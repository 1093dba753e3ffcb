"""The connected surface at a pixel."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from abs_service.tracker.detection.depth_segments import surface_at
from abs_service.tracker.detection.depth_view import DepthView
from abs_service.tracker.detection.within import Restricted, restricted


@dataclass(frozen=True)
class Settings:
    """TOML keys of the region.

    Attributes:
        pixel: column and row of a pixel of the object in the depth image [px].
        largest_step_m: largest difference in distance between neighbouring pixels of one surface [m].
        least_pixels: minimum number of pixels of a surface; smaller ones are ignored as noise.
        within: mask image as of the region `mask`; pixels outside are ignored.
    """

    pixel: tuple[Annotated[int, Ge(0)], Annotated[int, Ge(0)]]
    largest_step_m: Annotated[float, Gt(0)] = 0.04
    least_pixels: Annotated[int, Ge(16)] = 16
    within: Path | None = None

    def build(self) -> Restricted:
        """The region; DetectionError if `within` is missing or no image."""
        return restricted(self._at_pixel, self.within)

    def _at_pixel(self, view: DepthView) -> NDArray[np.bool_]:
        """Pixels (height, width) of the connected surface at the pixel, or nearest to it within a few pixels.

        Raises:
            DetectionError: the pixel is outside the image, or there is no surface near it.
        """
        return surface_at(self.pixel, view.distance, self.largest_step_m, self.least_pixels)
