"""A box in rig coordinates."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.initial_detection import DetectionError

LEAST_PIXELS = 16


@dataclass(frozen=True)
class Settings:
    """TOML keys of the region.

    Attributes:
        lowest, highest: opposite corners (x, y, z) of the box in the rig's frame [m].
    """

    lowest: tuple[float, float, float]
    highest: tuple[float, float, float]

    def __post_init__(self) -> None:
        if not all(low < high for low, high in zip(self.lowest, self.highest)):
            raise DetectionError(
                f"lowest = {list(self.lowest)} must be below highest = {list(self.highest)} on every axis"
            )

    def build(self) -> "Settings":
        """The region itself: its TOML keys are its fields."""
        return self

    def select(self, points_r: NDArray[np.float64], distance: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Pixels (height, width) whose points lie inside the box."""
        with np.errstate(invalid="ignore"):
            inside = np.all((points_r >= self.lowest) & (points_r <= self.highest), axis=-1)
        if np.count_nonzero(inside) < LEAST_PIXELS:
            raise DetectionError(f"the box {list(self.lowest)} … {list(self.highest)} holds no surface")
        return inside
