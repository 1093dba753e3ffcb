"""Arms: surfaces that reach in over the image's border to an object on a plane, and where they are cut off."""

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.depth_view import DepthView
from abs_service.tracker.detection.plausibility import BELOW_BORDER_PX, at_border
from abs_service.tracker.detection.segments.neighbourhood import grown, square

#: A surface rests on a plane where the plane goes on within so many pixels at about the same distance [m]: surfaces end
#: some pixels inside, and up to the clearance above the plane.
BESIDE_PX, SAME_M = 5, 0.02

#: Fewer pixels along the border, or beside the plane, may be noise.
MIN_PIXELS = 8

#: What comes in over the border lies on the plane if it rests within this share of the image's width; else it hovers.
HOVERS = 1 / 16

#: Number of steps over which the width of an arm is averaged [px].
_WIDTH_STEPS = 9

_CROSS, _SQUARE = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8), square(1)


def resting(surface: NDArray[np.bool_], plane: NDArray[np.bool_], view: DepthView) -> NDArray[np.bool_]:
    """Pixels (height, width) of a surface beside which the plane goes on at about the same distance.

    Args:
        surface: its pixels (height, width).
        plane: pixels (height, width) of the plane.
        view: the depth image.
    """
    around = square(BESIDE_PX)
    farthest = cv2.dilate(np.where(surface, view.distance, np.float32(0)), around)
    nearest = cv2.erode(np.where(surface, view.distance, np.float32(np.inf)), around)
    with np.errstate(invalid="ignore"):
        goes_on = plane & (view.distance > nearest - SAME_M) & (view.distance < farthest + SAME_M)
    return surface & grown(goes_on, BESIDE_PX)


def hovering_at_border(
    surface: NDArray[np.bool_], rests: NDArray[np.bool_], measured: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Pixels (height, width) at which a surface comes in over the image's border without resting on the plane there.

    Args:
        surface: its pixels (height, width).
        rests: those that rest on the plane, see `resting`.
        measured: pixels (height, width) with a return.
    """
    crossing = at_border(surface, measured)
    labels = np.asarray(cv2.connectedComponents(grown(crossing, 1).view(np.uint8))[1])
    lying = np.unique(labels[crossing & grown(rests, round(HOVERS * surface.shape[1]))])
    return crossing & ~np.isin(labels, lying)


def is_lone_arm(
    surface: NDArray[np.bool_], rests: NDArray[np.bool_], height: NDArray[np.float64], view: DepthView
) -> bool:
    """True if a surface touches no plane and comes in over the image's border higher above it than it is wide there.

    Args:
        surface: its pixels (height, width).
        rests: those that rest on the plane, see `resting`.
        height: heights (height, width) above the plane [m].
        view: the depth image.
    """
    crossing = hovering_at_border(surface, rests, view.measured)
    if rests.any() or not crossing.any():
        return False
    pixel_m = np.median(view.distance[crossing]) / min(view.camera.fx, view.camera.fy)
    return bool(np.median(height[crossing]) > np.count_nonzero(crossing) / BELOW_BORDER_PX * pixel_m)


def without_arms(
    surface: NDArray[np.bool_], rests: NDArray[np.bool_], measured: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """The part (height, width) of a surface that rests on a plane, without what reaches in over the image's border.

    Each such arm is cut off where it is narrowest on its way from the border to the first place that rests. The hand
    stays: it does not differ from the object in depth. Arguments as of `hovering_at_border`.
    """
    count, arms = cv2.connectedComponents(grown(hovering_at_border(surface, rests, measured), 1).view(np.uint8))
    kept = surface
    for label in range(1, count):
        start = surface & (arms == label)
        if np.count_nonzero(start) >= MIN_PIXELS <= np.count_nonzero(rests):
            kept = kept & ~_arm(surface, start, rests)
    if kept is surface:
        return surface
    parts = np.asarray(cv2.connectedComponents(kept.view(np.uint8), connectivity=4)[1])
    resting_pixels = np.bincount(parts[rests & kept], minlength=2)[1:]
    return parts == 1 + np.argmax(resting_pixels) if resting_pixels.any() else surface


def _arm(surface: NDArray[np.bool_], start: NDArray[np.bool_], rests: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Pixels (height, width) from the start of an arm to its narrowest place before it comes to what rests."""
    steps, reached, widths = np.zeros(surface.shape, np.int32), start.view(np.uint8), []
    inside = surface.view(np.uint8)
    while not (reached.view(np.bool_) & rests).any():  # grows in octagons
        wider = cv2.bitwise_and(cv2.dilate(reached, _SQUARE if len(widths) % 2 else _CROSS), inside)
        new = (wider > reached).view(np.bool_)
        if not new.any():
            return np.zeros(surface.shape, np.bool_)
        widths.append(np.count_nonzero(new))
        steps[new], reached = len(widths), wider
    if len(widths) < _WIDTH_STEPS:
        return np.zeros(surface.shape, np.bool_)
    mean = np.convolve(widths, np.ones(_WIDTH_STEPS), "valid")
    narrowest = len(mean) - 1 - int(np.argmin(mean[::-1])) + _WIDTH_STEPS // 2 + 1
    return reached.view(np.bool_) & (steps <= narrowest)
