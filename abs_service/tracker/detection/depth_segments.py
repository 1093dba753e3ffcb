"""Connected components of a depth image: pixels that belong to the same surface."""

import cv2
import numpy as np
from numpy.typing import NDArray

#: A pixel and its eight neighbours.
_AROUND = np.ones((3, 3))


def connected_surfaces(distance: NDArray[np.float32], largest_step: float) -> tuple[NDArray[np.int32], int]:
    """Label of every pixel's surface, 0 for none, and the number of labels.

    Surfaces are separated at jumps in distance; the image is smoothed first, because a single noisy pixel would
    otherwise connect or split surfaces.

    Args:
        distance: radial distances (height, width) [m], NaN without return.
        largest_step: largest difference between connected neighbours [m].
    """
    known = np.isfinite(distance)
    smooth = cv2.medianBlur(np.where(known, distance, 0).astype(np.float32, copy=False), 5)
    highest, lowest = cv2.dilate(smooth, _AROUND), cv2.erode(smooth, _AROUND)
    surface = (known & (lowest > 0) & (highest - lowest < largest_step)).view(np.uint8)
    count, labels = cv2.connectedComponents(surface, connectivity=4)
    return np.asarray(labels, np.int32), count
