"""Motion detection on a board from one image to the next."""

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.board.corners.to_8bit import Grey

#: A difference between two images is a change if it exceeds this many robust deviations …
_DEVIATIONS = 6.0
#: … and this many levels of 256.
_LEVELS = 12.0
#: Largest changed fraction of the board's pixels.
MAX_CHANGED_FRACTION = 0.01


def changed_fraction(before: Grey, after: Grey, pixels: NDArray[np.float64]) -> float:
    """Fraction of the pixels in the hull of points (n, 2) that changed between two images (height, width), 0 to 1.

    Differences are normalised by their own robust deviation, so that noise is no change; a motion of a third of a pixel
    changes the pixels along all edges of the print.
    """
    inside = np.zeros(after.shape, np.uint8)
    cv2.fillConvexPoly(inside, np.rint(cv2.convexHull(pixels.astype(np.float32))).astype(np.int32), 1)
    difference = after[inside > 0].astype(np.float32) - before[inside > 0]
    if not difference.size:
        return 0.0
    difference -= np.median(difference)
    # At least a fifth of the pixels is unaffected by motion; a fifth of a normal distribution lies within 0.253 σ.
    sigma = float(np.quantile(np.abs(difference), 0.2)) / 0.253
    return float(np.mean(np.abs(difference) > max(_DEVIATIONS * sigma, _LEVELS)))
