"""Connected components of a depth image: pixels that belong to the same surface."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.initial_detection import DetectionError

#: A pixel and its eight neighbours.
_AROUND = np.ones((3, 3))

#: Distance within which the surface at a pixel is looked for [px]: there may be no return at the pixel itself, and
#: surfaces end a little inside their outlines.
REACH_PX = 10


@dataclass(frozen=True, slots=True, eq=False)
class Surfaces:
    """Connected surfaces of a depth image.

    Attributes:
        distance: radial distances (height, width) [m], NaN without return.
        smooth: medians of squares of five pixels a side [m], zero where most have no return.
        labels: label of every pixel's surface, 0 for none.
        count: number of labels, that for none included.
    """

    distance: NDArray[np.float32]
    smooth: NDArray[np.float32]
    labels: NDArray[np.int32]
    count: int


def connected_surfaces(distance: NDArray[np.float32], maximum_step: NDArray[np.float32] | float) -> Surfaces:
    """Surfaces that are separated at jumps in distance.

    The image is smoothed first, because a single noisy pixel would otherwise connect or split surfaces.

    Args:
        distance: radial distances (height, width) [m], NaN without return.
        maximum_step: largest difference between connected neighbours [m], of all pixels or of each (height, width).
    """
    known = np.isfinite(distance)
    smooth = cv2.medianBlur(cv2.copyTo(distance, known.view(np.uint8)), 5)  # zero where unknown
    highest, lowest = cv2.dilate(smooth, _AROUND), cv2.erode(smooth, _AROUND)
    surface = (known & (lowest > 0) & (highest - lowest < maximum_step)).view(np.uint8)
    count, labels = cv2.connectedComponents(surface, connectivity=4)
    return Surfaces(distance, np.asarray(smooth, np.float32), np.asarray(labels, np.int32), count)


def large_surfaces(
    distance: NDArray[np.float32], maximum_step: NDArray[np.float32] | float, minimum_pixels: int
) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Label of every pixel's surface, 0 for none, and the labels (k,) of the large surfaces, the largest first.

    Args:
        distance: radial distances (height, width) [m], NaN without return.
        maximum_step: see `connected_surfaces`.
        minimum_pixels: minimum number of pixels of a surface.

    Raises:
        DetectionError: no surface is large enough.
    """
    surfaces = connected_surfaces(distance, maximum_step)
    labels = surfaces.labels
    sizes = np.bincount(labels.ravel(), minlength=surfaces.count)[1:]
    by_size = 1 + np.argsort(-sizes, kind="stable")
    large = by_size[sizes[by_size - 1] >= minimum_pixels]
    if not len(large):
        largest = int(sizes.max(initial=0))
        raise DetectionError(
            f"no connected surface of at least minimum_pixels = {minimum_pixels} pixels in sight; "
            f"the largest has {largest}"
        )
    return labels, large


def surface_at(
    pixel: tuple[int, int],
    distance: NDArray[np.float32],
    maximum_step: NDArray[np.float32] | float,
    minimum_pixels: int,
) -> NDArray[np.bool_]:
    """Pixels (height, width) of the connected surface at a pixel, or else of the one nearest to it within `REACH_PX`.

    Args:
        pixel: its column and row.
        distance, maximum_step, minimum_pixels: see `large_surfaces`.

    Raises:
        DetectionError: the pixel is outside the image, or there is no surface near it.
    """
    height, width = distance.shape
    if not (0 <= pixel[0] < width and 0 <= pixel[1] < height):
        raise DetectionError(f"the pixel {list(pixel)} is outside the depth image of {width} × {height} pixels")
    labels, large = large_surfaces(distance, maximum_step, minimum_pixels)
    rows, columns = np.nonzero(np.isin(labels, large))
    away = np.hypot(columns - pixel[0], rows - pixel[1])
    nearest = int(np.argmin(away))
    row, column = rows[nearest], columns[nearest]
    if away[nearest] > REACH_PX:
        raise DetectionError(
            f"no connected surface of at least minimum_pixels = {minimum_pixels} pixels within {REACH_PX} pixels of "
            f"{list(pixel)}; the nearest one is {away[nearest]:.0f} pixels away, at [{column}, {row}]"
        )
    return labels == labels[row, column]


def is_within_reach(pixel: tuple[int, int], surface: NDArray[np.bool_]) -> bool:
    """True if a surface (height, width) has a pixel within `REACH_PX` of a pixel, its column and row."""
    rows, columns = np.nonzero(surface)
    return bool(np.hypot(columns - pixel[0], rows - pixel[1]).min(initial=np.inf) <= REACH_PX)


def deepest_pixel(surface: NDArray[np.bool_]) -> tuple[int, int]:
    """Row and column of a surface's pixel (height, width) that is farthest inside it."""
    depth = cv2.distanceTransform(np.pad(surface, 1).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)[1:-1, 1:-1]
    row, column = np.unravel_index(np.argmax(depth), depth.shape)
    return int(row), int(column)
