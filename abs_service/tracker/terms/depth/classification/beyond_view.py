"""Missing returns beyond a depth sensor's field of view: they show neither a background nor a hole.

A field of view may end before the image does. Structured light finds no match in the last columns at one side; that of
some time-of-flight sensors is a hexagon or a circle; registration to another camera gives it any convex outline. What
is cut off there does not end there itself.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Window
from abs_service.tracker.detection.segments.neighbourhood import grown, square

#: A field of view fills at least this share of the image: less may be objects before a background without return.
MIN_AREA = 0.5
#: Along its edge it has returns in at least this share of the pixels, and in at least that share of something else
#: than the object: what is before a background without return ends there by itself.
MIN_RETURNS, MIN_OTHERS = 0.5, 0.25
#: Its edge is a stripe of this share of the image's width; returns may be missing in it.
EDGE_SHARE = 0.01
#: A sensor measures nothing in the outermost rows or columns, up to this share of them, whatever ends along the other
#: sides: where two views are matched, or distances are registered to another camera. Returns as near to the predicted
#: mesh may be the object's, since that ends up to a cell inside: 24 px if it fills most of 640 × 480.
BLIND_SHARE = 0.08
#: Returns that are fewer in the square of three pixels a side around them are strays.
MIN_NEIGHBOURS = 3


class BeyondView:
    """Pixels beyond the field of view, learnt from the first depth image."""

    def __init__(self) -> None:
        self._beyond = np.zeros((0, 0), np.bool_)
        self._begun = False

    def observe(self, missing: NDArray[np.bool_], expected: NDArray[np.bool_], window: Window) -> NDArray[np.bool_]:
        """Missing returns (rows, columns) beyond the field of view; the first call learns.

        Args:
            missing: pixels without return (rows, columns) in the window.
            expected: silhouette of the predicted mesh there.
            window: of the image; the first one has to be the whole image.
        """
        if not self._begun:
            self._begun = True
            self._beyond = beyond(missing, expected)
        return missing & self._beyond[window]


def beyond(missing: NDArray[np.bool_], expected: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Pixels (height, width) outside the convex hull of the returns, and at its edge, if that is a field of view's.

    Args:
        missing: pixels without return (height, width).
        expected: silhouette of the object.
    """
    blind, returns = np.zeros(missing.shape, np.bool_), ~missing
    neighbours = cv2.boxFilter(returns.view(np.uint8), cv2.CV_8U, (3, 3), normalize=False)
    corners = cv2.findNonZero((returns & (neighbours >= MIN_NEIGHBOURS)).view(np.uint8))
    if corners is None:
        return blind
    reach = round(BLIND_SHARE * missing.shape[1])
    others = ~grown(expected, reach)
    strays = neighbours < MIN_NEIGHBOURS
    for turn in range(4):  # views: every side of the image becomes the left one
        count = _blind_columns(*(np.rot90(mask, turn) for mask in (returns & ~strays, others)))
        np.rot90(blind, turn)[:, :count] = True
    hull = cv2.fillConvexPoly(np.zeros(missing.shape, np.uint8), cv2.convexHull(corners), 1)
    stripe = max(round(EDGE_SHARE * missing.shape[1]), 1)
    inner = cv2.erode(hull, square(stripe), borderValue=1) > 0
    edge = (hull > 0) & ~inner
    there = edge & returns
    length, measured, of_others = (np.count_nonzero(mask) for mask in (edge, there, there & others))
    ends = measured >= MIN_RETURNS * length and of_others >= MIN_OTHERS * length
    return ~inner | blind if ends and np.count_nonzero(hull) >= MIN_AREA * hull.size else blind


def _blind_columns(returns: NDArray[np.bool_], others: NDArray[np.bool_]) -> int:
    """Number of first columns that are blind: a straight line of returns begins after them, not of the object alone.

    Args:
        returns: pixels with a return (height, width).
        others: pixels that are far from the object (height, width).
    """
    seen = np.flatnonzero(returns.any(axis=0))
    first = int(seen[0]) if seen.size else 0
    if not 0 < first <= BLIND_SHARE * returns.shape[1]:
        return 0
    line = returns[:, first : first + max(round(EDGE_SHARE * returns.shape[1]), 1)]
    of_others = line & others[:, first : first + line.shape[1]]
    return first if np.mean(line) >= MIN_RETURNS and np.mean(of_others) >= MIN_OTHERS else 0
