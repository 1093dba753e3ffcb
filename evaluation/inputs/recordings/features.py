"""Corners of an image, tracked from frame to frame without the tracker under test."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

#: At most so many corners, of at least this quality of the best, so far apart [px], so far from the mask's rim [px].
CORNERS, QUALITY, APART_PX, RIM_PX = 200, 0.01, 3.0, 3

#: Side of the window that is compared [px], and coarser images of half the size each.
WINDOW_PX, LEVELS = 11, 2

#: A corner is lost if, tracked to a frame and back, it misses where it was by more than this [px].
RETURN_PX = 0.5


def corners(image: NDArray[np.uint8], mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Corners (n, 2) [px] of an image (height, width) inside an object's mask (height, width), not at its rim."""
    within = cv2.erode(mask.astype(np.uint8), np.ones((2 * RIM_PX + 1,) * 2, np.uint8))
    found = cv2.goodFeaturesToTrack(image, CORNERS, QUALITY, APART_PX, mask=within)
    return np.zeros((0, 2), np.float32) if found is None else np.asarray(found, np.float32).reshape(-1, 2)


def tracks(
    images: Sequence[NDArray[np.uint8]], masks: Sequence[NDArray[np.bool_]], places: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Positions (frames, n, 2) [px] of what is at some places (n, 2) [px] of the first image; NaN once it is lost.

    Optical flow (Lucas and Kanade) from every image to the next and back. What leaves the object's mask is lost:
    something covers it, or it has slid.

    Args:
        images: brightness (height, width) of every frame.
        masks: the object's pixels (height, width) in every frame.
        places: corners, or other places that differ from their surroundings.
    """
    found = [np.asarray(places, np.float32)]
    for before, after, mask in zip(images[:-1], images[1:], masks[1:], strict=True):
        found.append(_tracked(before, after, mask, found[-1]))
    return np.array(found, np.float64)


def _tracked(
    before: NDArray[np.uint8], after: NDArray[np.uint8], mask: NDArray[np.bool_], places: NDArray[np.float32]
) -> NDArray[np.float32]:
    """The places (n, 2) [px] in the next image, NaN where they are lost."""
    result, kept = np.full_like(places, np.nan), np.flatnonzero(np.isfinite(places).all(axis=1))
    if not len(kept):
        return result
    there, found = _flow(before, after, places[kept])
    back, returned = _flow(after, before, there)
    missed = np.linalg.norm(back - places[kept], axis=1)
    good = found & returned & (missed <= RETURN_PX) & _in(mask, there)
    result[kept[good]] = there[good]
    return result


def _flow(
    one: NDArray[np.uint8], other: NDArray[np.uint8], places: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    start = np.ascontiguousarray(places[:, None], np.float32)
    flow = cv2.calcOpticalFlowPyrLK(one, other, start, start.copy(), winSize=(WINDOW_PX,) * 2, maxLevel=LEVELS)
    return np.asarray(flow[0], np.float32)[:, 0], np.asarray(flow[1])[:, 0] > 0


def _in(mask: NDArray[np.bool_], places: NDArray[np.float32]) -> NDArray[np.bool_]:
    """True for places (n, 2) [px] that are pixels of a mask (n,)."""
    column, row = np.floor(places + 0.5).astype(int).T
    seen = (column >= 0) & (column < mask.shape[1]) & (row >= 0) & (row < mask.shape[0])
    inside = np.zeros(len(places), bool)
    inside[seen] = mask[row[seen], column[seen]]
    return inside
