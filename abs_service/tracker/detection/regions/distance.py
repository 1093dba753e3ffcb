"""The largest connected surface within a range of distances."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from abs_service.tracker.detection.depth_view import DepthView, Step, limited
from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.detection.segments.depth_segments import large_surfaces
from abs_service.tracker.detection.segments.within import Polygon, Restricted, restricted


@dataclass(frozen=True)
class Settings:
    """TOML keys of the region.

    Attributes:
        maximum_m: largest radial distance of the object [m].
        minimum_m: smallest radial distance of the object [m].
        maximum_step_m: largest difference in distance between neighbouring pixels of one surface [m]; "auto": 0.04, or
            five standard deviations of the distance by the noise model, or 3.5 widths of a pixel on the surface, where
            that is more.
        minimum_pixels: minimum number of pixels of a surface; smaller ones are ignored as noise.
        within: mask image as of the region `mask`; pixels outside are ignored.
        polygon: corners (column, row) of a polygon around the object [px], three or more; pixels outside are ignored.
    """

    maximum_m: Annotated[float, Gt(0)]
    minimum_m: Annotated[float, Ge(0)] = 0.0
    maximum_step_m: Step = "auto"
    minimum_pixels: Annotated[int, Ge(16)] = 200
    within: Path | None = None
    polygon: Polygon | None = None

    def __post_init__(self) -> None:
        if not self.minimum_m < self.maximum_m:
            raise DetectionError(f"minimum_m = {self.minimum_m} must be below maximum_m = {self.maximum_m}")

    def build(self) -> Restricted:
        """The region; DetectionError if `within` is missing or no image."""
        return restricted(self._largest, self.within, self.polygon)

    def _largest(self, view: DepthView) -> NDArray[np.bool_]:
        """Pixels (height, width) of the largest connected surface in the range; DetectionError if there is none."""
        with np.errstate(invalid="ignore"):
            in_range = (view.distance >= self.minimum_m) & (view.distance <= self.maximum_m)
        try:
            labels, large = large_surfaces(
                limited(view, in_range).distance, view.step(self.maximum_step_m), self.minimum_pixels
            )
        except DetectionError as error:
            raise DetectionError(f"from {self.minimum_m:g} to {self.maximum_m:g} m: {error}") from None
        return labels == large[0]
