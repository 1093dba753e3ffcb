"""Whether a board was held still: what changed on it from one image to the next."""

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.board.corners.to_8bit import Grey

#: A difference between two images counts as a change from so many of its usual deviations on …
_DEVIATIONS = 6.0
#: … and from so many levels of 256.
_LEVELS = 12.0
#: Part of the board's pixels that may have changed.
LARGEST_CHANGE = 0.01


def changed(before: Grey, after: Grey, pixels: NDArray[np.float64]) -> float:
    """Part of the pixels in the hull of points (n, 2) that changed from one image (height, width) to the next, 0 to 1.

    Differences are compared with their own usual size, so that noise is no change; a motion by a third of a pixel
    changes what lies along all edges of the print.
    """
    inside = np.zeros(after.shape, np.uint8)
    cv2.fillConvexPoly(inside, np.rint(cv2.convexHull(pixels.astype(np.float32))).astype(np.int32), 1)
    difference = after[inside > 0].astype(np.float32) - before[inside > 0]
    if not difference.size:
        return 0.0
    difference -= np.median(difference)
    # A fifth of the board looks the same however it moves; a fifth of a normal distribution is within 0.253 σ.
    usual = float(np.quantile(np.abs(difference), 0.2)) / 0.253
    return float(np.mean(np.abs(difference) > max(_DEVIATIONS * usual, _LEVELS)))
