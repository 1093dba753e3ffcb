"""A box in rig coordinates."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.depth_view import DepthView
from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.detection.segments.within import Polygon, Restricted, restricted
from calib import pose

MIN_PIXELS = 16


@dataclass(frozen=True)
class Settings:
    """TOML keys of the region.

    Attributes:
        lowest: corner of least x, y, z of the box in the rig's frame, before it is turned [m].
        highest: corner of largest x, y, z of the box in the rig's frame, before it is turned [m].
        rotation: rotation vector that turns the box about its centre, in the rig's frame [rad].
        within: mask image as of the region `mask`; pixels outside are ignored.
        polygon: corners (column, row) of a polygon around the object [px], three or more; pixels outside are ignored.
    """

    lowest: tuple[float, float, float]
    highest: tuple[float, float, float]
    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    within: Path | None = None
    polygon: Polygon | None = None

    def __post_init__(self) -> None:
        if not all(low < high for low, high in zip(self.lowest, self.highest)):
            raise DetectionError(
                f"lowest = {list(self.lowest)} must be below highest = {list(self.highest)} on every axis"
            )

    def build(self) -> Restricted:
        """The region; DetectionError if `within` is missing or no image."""
        return restricted(self._inside, self.within, self.polygon)

    def _inside(self, view: DepthView) -> NDArray[np.bool_]:
        """Pixels (height, width) whose points lie inside the box; DetectionError if there are too few."""
        lowest, highest = np.array(self.lowest), np.array(self.highest)
        T_rb = pose.from_rotation_vector(self.rotation, (lowest + highest) / 2)  # b: the box, origin in its centre
        with np.errstate(invalid="ignore"):
            points_b = pose.transform(pose.inverse(T_rb), view.points_r)
            inside = np.all(np.abs(points_b) <= (highest - lowest) / 2, axis=-1) & view.measured
        if np.count_nonzero(inside) < MIN_PIXELS:
            turned = f" turned by {list(self.rotation)} rad" if any(self.rotation) else ""
            raise DetectionError(f"the box {list(self.lowest)} … {list(self.highest)}{turned} holds no surface")
        return inside
