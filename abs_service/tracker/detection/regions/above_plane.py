"""The object on the dominant plane, such as a table, or before one, such as a wall."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from abs_service.tracker.detection.depth_view import DepthView, limited
from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.detection.plausibility import border_length
from abs_service.tracker.detection.segments.depth_segments import (
    deepest_pixel,
    is_within_reach,
    large_surfaces,
    surface_at,
)
from abs_service.tracker.detection.segments.dominant_plane import CLEARANCE_M, above_plane, heights_above_plane
from abs_service.tracker.detection.segments.reaching_in import is_lone_arm, resting, without_arms
from abs_service.tracker.detection.segments.surface_settings import SurfaceSettings
from abs_service.tracker.detection.segments.within import Restricted, restricted

#: A surface with less than this share of the pixels of the largest one, a wall or an arm, is ignored.
SPECK = 0.02

#: The plane ends at this percentile of its distances: some pixels of what is beyond lie in the plane as well.
PLANE_PERCENT = 95


@dataclass(frozen=True)
class Settings(SurfaceSettings):
    """TOML keys of the region.

    Attributes:
        clearance_m: height above the plane up to which a pixel belongs to it [m]; several standard deviations of the
            distances there.
        seed: column and row of a pixel of the object [px]; without it, the object is the largest connected surface,
            unless that may be a wall or a floor. Without `within` and `polygon`, an arm that reaches in over the
            image's border is left out.
        within: mask image as of the region `mask`; pixels outside are ignored, except for finding the plane.
        polygon: corners (column, row) of a polygon around the object [px], three or more; pixels outside are ignored,
            except for finding the plane.
    """

    clearance_m: Annotated[float, Gt(0)] = CLEARANCE_M
    seed: tuple[Annotated[int, Ge(0)], Annotated[int, Ge(0)]] | None = None

    def build(self) -> Restricted:
        """The region; DetectionError if `within` is missing or no image."""
        if self.within is None and self.polygon is None:
            return restricted(self._unlimited, None, None)
        return Restricted(self._above, restricted(self._selected, self.within, self.polygon).select)

    def _unlimited(self, view: DepthView) -> NDArray[np.bool_]:
        """Pixels (height, width) of the object in an entire view; DetectionError if there is none, or in doubt."""
        height = heights_above_plane(view, self.clearance_m)
        with np.errstate(invalid="ignore"):
            plane, above = np.abs(height) <= self.clearance_m, limited(view, height > self.clearance_m)
        if self.seed is not None:
            thing = self._selected(above)
            rests = resting(thing, plane, view)
            alone = without_arms(thing, rests, view.measured)
            return alone if is_within_reach(self.seed, alone) else thing
        labels, large = self._surfaces(above)
        things = _before_background([labels == label for label in large], plane, view)
        if border_length(things[0], view.measured):
            self._refuse_background(things[0], things[1:], view)
            return things[0]
        for thing in things:
            if _is_speck(thing, things[0]):
                continue
            rests = resting(thing, plane, view)
            if not is_lone_arm(thing, rests, height, view):
                return without_arms(thing, rests, view.measured)
        return things[0]

    def _refuse_background(self, main: NDArray[np.bool_], others: list[NDArray[np.bool_]], view: DepthView) -> None:
        """DetectionError if one of the other surfaces is a thing before the main one, the largest, and no speck."""
        pixels, away = np.count_nonzero(main), np.median(view.distance[main])
        medians = {
            float(np.median(view.distance[other])): other
            for other in others
            if not (_is_speck(other, main) or border_length(other, view.measured))
        }
        if medians and min(medians) < away:
            row, column = deepest_pixel(medians[min(medians)])
            share = pixels / np.count_nonzero(view.measured)
            raise DetectionError(
                f"the largest surface above the plane has {share:.0%} of all returns and lies along the image's "
                f"border, like a wall or a floor, and another one is nearer, at [{column}, {row}]: "
                'set region.seed to a pixel of the object, or region.type to "box"'
            )

    def _above(self, view: DepthView) -> DepthView:
        """The view without the plane and everything beyond it; DetectionError if there is no plane."""
        return limited(view, above_plane(view, self.clearance_m))

    def _selected(self, view: DepthView) -> NDArray[np.bool_]:
        """Pixels (height, width) of the object among those above the plane; DetectionError if there is none."""
        if self.seed is None:
            labels, large = self._surfaces(view)
            return labels == large[0]
        try:
            return surface_at(self.seed, view.distance, view.step(self.maximum_step_m), self.minimum_pixels)
        except DetectionError as error:
            raise self._nothing(error) from None

    def _surfaces(self, view: DepthView) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
        """`large_surfaces` of what is above the plane; DetectionError if there is none."""
        try:
            return large_surfaces(view.distance, view.step(self.maximum_step_m), self.minimum_pixels)
        except DetectionError as error:
            raise self._nothing(error) from None

    def _nothing(self, error: DetectionError) -> DetectionError:
        return DetectionError(f"more than clearance_m = {self.clearance_m:g} m above the plane: {error}")


def _before_background(
    surfaces: list[NDArray[np.bool_]], plane: NDArray[np.bool_], view: DepthView
) -> list[NDArray[np.bool_]]:
    """The surfaces, the largest first, without those that are larger than all things but beyond the plane's end.

    Such a wall lies along the image's border. All of them if the others are specks.
    """
    end = np.percentile(view.distance[plane], PLANE_PERCENT)
    for k, surface in enumerate(surfaces):
        if not (border_length(surface, view.measured) and np.median(view.distance[surface]) > end):
            return surfaces if _is_speck(surface, surfaces[0]) else surfaces[k:]
    return surfaces


def _is_speck(surface: NDArray[np.bool_], main: NDArray[np.bool_]) -> bool:
    """True if a surface is too small beside the largest one to be a thing."""
    return bool(np.count_nonzero(surface) < SPECK * np.count_nonzero(main))
