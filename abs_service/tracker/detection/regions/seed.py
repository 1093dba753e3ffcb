"""The connected surface at a pixel, of a colour, or that moves."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le
from numpy.typing import NDArray

from abs_service.tracker.detection.depth_view import DepthView
from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.detection.plausibility import is_scene
from abs_service.tracker.detection.segments.color_growth import grown_by_color
from abs_service.tracker.detection.segments.seeds import ColorSeed, MotionSeed, PixelSeed, Seed, Seeded, SurfaceLimits
from abs_service.tracker.detection.segments.surface_settings import SurfaceSettings
from abs_service.tracker.detection.segments.within import Restricted, restricted

Level = Annotated[int, Ge(0), Le(255)]


@dataclass(frozen=True)
class Settings(SurfaceSettings):
    """TOML keys of the region.

    Attributes:
        pixel: column and row of a pixel of the object in the depth image [px]. One of `pixel`, `color` and `motion_s`
            is needed.
        color: red, green, blue of the object; the largest surface of about this colour is it.
        motion_s: time within which the object moves [s]; pixels that moved in it belong to the object.
        grow: edges at which the object ends: steps in distance ("depth"), or edges of its colours, too ("color").
        minimum_motion_m: least change towards the sensor of a surface that has moved [m]; it is four standard
            deviations of the distances at least.
        minimum_pixels: minimum number of pixels of a surface, and of what moved or has the colour; less is noise.
    """

    pixel: tuple[Annotated[int, Ge(0)], Annotated[int, Ge(0)]] | None = None
    color: tuple[Level, Level, Level] | None = None
    motion_s: Annotated[float, Ge(0.5)] | None = None
    grow: Literal["depth", "color"] = "depth"
    minimum_motion_m: Annotated[float, Gt(0)] = 0.02
    minimum_pixels: Annotated[int, Ge(16)] = field(default=16, kw_only=True)

    def __post_init__(self) -> None:
        self._seed()

    def build(self) -> Restricted:
        """The region; DetectionError if `within` is missing or no image."""
        seed, limits = self._seed(), SurfaceLimits(self.maximum_step_m, self.minimum_pixels)

        def select(view: DepthView) -> NDArray[np.bool_]:
            seeded = seed(view, limits)
            if self.grow == "color":
                return grown_by_color(seeded, view)
            return _apart_from_what_rests(seeded, view) if self.motion_s is not None else seeded.surface

        return restricted(select, self.within, self.polygon)

    def _seed(self) -> Seed:
        match self.pixel, self.color, self.motion_s:
            case (_, _) as pixel, None, None:
                return PixelSeed(pixel)
            case None, (_, _, _) as color, None:
                return ColorSeed(color)
            case None, None, float() | int() as seconds:
                return MotionSeed(seconds, self.minimum_motion_m)
        given = [name for name in ("pixel", "color", "motion_s") if getattr(self, name) is not None]
        raise DetectionError(
            f"one of pixel, color and motion_s says where the object is, not {' and '.join(given) or 'none'}"
        )


def _apart_from_what_rests(seeded: Seeded, view: DepthView) -> NDArray[np.bool_]:
    """The surface of what moved; DetectionError if it is the scene, and most of it rests."""
    size, whole = np.count_nonzero(seeded.surface), np.count_nonzero(view.measured)
    if np.count_nonzero(seeded.core) < size / 2 and is_scene(seeded.surface, view.measured):
        raise DetectionError(
            f"what moved is connected to {size / whole:.0%} of all returns, which span the image and rest: that is the "
            'scene, not an object. Set region.grow to "color", region.polygon to corners around the object, or a '
            "smaller region.maximum_step_m, or take the object away from what it touches"
        )
    return seeded.surface
