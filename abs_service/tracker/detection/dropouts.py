"""Returns that a sensor loses pixel by pixel, as where a surface is dark or far: gaps in a surface, and not its end."""

import cv2
import numpy as np
from numpy.typing import NDArray

#: Side of the smallest square of missing returns that is an area [px].
AREA_PX = 3
_AREA = np.ones((AREA_PX, AREA_PX))

#: Share of the pixels around a gap [px] that are gaps as well, from which on returns are missing everywhere. Along the
#: outline of a thing before a background, a row of two pixels without return has less: it separates both.
WINDOW_PX, MIN_SHARE = 15, 0.2


def dropouts(missing: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Missing returns (rows, columns) of single pixels and thin rows of them, which are no area (an opening).

    A sensor loses them one by one, as likely as its probability of no return says; an area is lost for a reason that
    all its pixels share.
    """
    if not missing.any():
        return missing
    areas = cv2.morphologyEx(missing.view(np.uint8), cv2.MORPH_OPEN, _AREA)
    return missing & (areas == 0)


def sparse_gaps(known: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Dropouts (height, width) where returns are missing pixel by pixel everywhere.

    Args:
        known: pixels (height, width) with a return.
    """
    gaps = dropouts(~known)
    box = WINDOW_PX, WINDOW_PX
    missing, there = (cv2.boxFilter(one.view(np.uint8), cv2.CV_32F, box) for one in (gaps, gaps | known))
    return gaps & (missing > MIN_SHARE * there)


def fill_gaps(distance: NDArray[np.float32]) -> NDArray[np.float32]:
    """Distances (height, width) [m] with the least one beside it in each sparse gap; NaN without return."""
    known = np.isfinite(distance)
    nearest = cv2.erode(np.where(known, distance, np.float32(np.inf)), _AREA)
    return np.where(sparse_gaps(known), nearest, distance)
