"""Distances of pixels from the outline of the object in a depth image."""

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Window
from abs_service.tracker.synthesis.window import WHOLE
from abs_service.tracker.terms.depth.classification.visibility import Visibility
from calib.jit import kernel


def around(mask: NDArray[np.bool_], reach: int) -> Window:
    """Rows and columns within so many pixels of those of a mask (height, width), which is not empty."""
    axes = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    rows, columns = (slice(max(int(at[0]) - reach, 0), int(at[-1]) + reach + 1) for at in axes)
    return rows, columns


def inwards(distance: NDArray[np.float32], seen: Visibility, reach: int) -> tuple[Window, NDArray[np.float32]]:
    """Distance of pixels from the object's outline [px], negative outside it; NaN if unknown.

    Occluders and holes are unknown: the object may continue there. A dropout is beside it if most pixels around it are.

    Args:
        distance, seen: an image (height, width) [m], and what it shows.
        reach: pixels outside the object up to which distances are needed [px].

    Returns:
        The part of the image that is not farther outside, and the distances there (rows, columns).
    """
    beside = (seen.free_m > 0) | (np.isnan(distance) & ~(seen.hole | seen.dropout))
    if seen.dropout.any():
        beside |= outvoted(seen.dropout, beside)
    if not (beside.any() and seen.object.any()):
        return WHOLE, np.full(distance.shape, np.nan, np.float32)
    part = around(~beside, reach)
    outside = np.ascontiguousarray(beside[part])
    to_inside, to_outside = (
        np.asarray(cv2.distanceTransform(mask.view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5), np.float32)
        for mask in (outside, ~outside)
    )
    away = np.empty(outside.shape, np.float32)
    join_sides(to_inside, to_outside, seen.foreground, seen.hole, (part[0].start, part[1].start), away)
    return part, away


@kernel
def join_sides(
    to_inside: NDArray[np.float32],
    to_outside: NDArray[np.float32],
    foreground: NDArray[np.bool_],
    hole: NDArray[np.bool_],
    corner: tuple[int, int],
    away: NDArray[np.float32],
) -> None:
    """Distances inside an outline between pixels (rows, columns), from those to the next pixel of either side [px].

    Args:
        to_inside, to_outside: 0 on the own side.
        foreground, hole: pixels of an image (height, width) for which the distance is unknown.
        corner: first row and column of the part of the image.
        away: result, NaN where unknown.
    """
    (top, left), half = corner, np.float32(0.5)
    for row in range(away.shape[0]):
        for column in range(away.shape[1]):
            at, outwards = (top + row, left + column), to_inside[row, column]
            inwards = half - outwards if outwards > 0 else to_outside[row, column] - half
            away[row, column] = np.float32(np.nan) if foreground[at] or hole[at] else inwards


def outvoted(dropout: NDArray[np.bool_], beside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Dropouts (height, width) most of whose eight neighbours with a return lie beside the object."""
    result = np.zeros(dropout.shape, np.bool_)
    _vote(dropout, beside, result)
    return result


@kernel
def _vote(dropout: NDArray[np.bool_], beside: NDArray[np.bool_], result: NDArray[np.bool_]) -> None:
    """Writes what `outvoted` returns into False; beyond the border, the image is its mirror image."""
    height, width = dropout.shape
    for row in range(height):
        for column in range(width):
            if not dropout[row, column]:
                continue
            votes = 0
            for down in range(-1, 2):
                y = height - 1 - abs(height - 1 - abs(row + down))
                for right in range(-1, 2):
                    x = width - 1 - abs(width - 1 - abs(column + right))
                    if not dropout[y, x]:
                        votes += 1 if beside[y, x] else -1
            result[row, column] = votes > 0
