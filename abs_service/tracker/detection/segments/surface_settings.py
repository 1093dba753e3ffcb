"""TOML keys of the regions that are one connected surface."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from annotated_types import Ge

from abs_service.tracker.detection.depth_view import Step
from abs_service.tracker.detection.segments.within import Polygon


@dataclass(frozen=True, kw_only=True)
class SurfaceSettings:
    """TOML keys of a region that is one connected surface.

    Attributes:
        maximum_step_m: largest difference in distance between neighbouring pixels of one surface [m]; "auto": 0.04, or
            five standard deviations of the distance by the noise model, or 3.5 widths of a pixel on the surface, where
            that is more.
        minimum_pixels: minimum number of pixels of a surface; smaller ones are ignored as noise.
        within: mask image as of the region `mask`; pixels outside are ignored.
        polygon: corners (column, row) of a polygon around the object [px], three or more; pixels outside are ignored.
    """

    maximum_step_m: Step = "auto"
    minimum_pixels: Annotated[int, Ge(16)] = 200
    within: Path | None = None
    polygon: Polygon | None = None
