"""The largest connected surface within a range of distances."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from abs_service.tracker.detection.depth_view import DepthView, limited
from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.detection.segments.depth_segments import large_surfaces
from abs_service.tracker.detection.segments.surface_settings import SurfaceSettings
from abs_service.tracker.detection.segments.within import Restricted, restricted


@dataclass(frozen=True)
class Settings(SurfaceSettings):
    """TOML keys of the region.

    Attributes:
        maximum_m: largest radial distance of the object [m].
        minimum_m: smallest radial distance of the object [m].
    """

    maximum_m: Annotated[float, Gt(0)]
    minimum_m: Annotated[float, Ge(0)] = 0.0

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
