"""Returns that are missing pixel by pixel, as where a surface is dark or far: gaps in a surface, and not its end."""

import cv2
import numpy as np
from numpy.typing import NDArray

#: A pixel and its eight neighbours: closes gaps of two pixels.
_AROUND = np.ones((3, 3))

#: Share of the pixels around a gap [px] that are gaps as well, from which on returns are missing everywhere. Along the
#: outline of a thing before a background, a row of two pixels without return has less: it separates both.
WINDOW_PX, LEAST_SHARE = 15, 0.2


def sparse_gaps(known: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Pixels (height, width) without return amid those with one, where returns are missing pixel by pixel.

    Args:
        known: pixels (height, width) with a return.
    """
    closed = cv2.morphologyEx(known.view(np.uint8), cv2.MORPH_CLOSE, _AROUND)
    gaps = np.asarray(closed, np.float32) - known
    there, missing = (cv2.boxFilter(np.asarray(one, np.float32), -1, (WINDOW_PX, WINDOW_PX)) for one in (closed, gaps))
    return np.asarray((gaps > 0) & (missing > LEAST_SHARE * there))


def filled(distance: NDArray[np.float32]) -> NDArray[np.float32]:
    """Distances (height, width) [m] with the least one beside it in each sparse gap; NaN without return."""
    known = np.isfinite(distance)
    nearest = cv2.erode(np.where(known, distance, np.float32(np.inf)), _AROUND)
    return np.where(sparse_gaps(known), nearest, distance)
