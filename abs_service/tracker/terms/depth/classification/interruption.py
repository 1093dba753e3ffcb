"""Missing returns that interrupt a surface: it goes on beyond them, so it does not end there.

A dark or shiny stripe, or the shadow of a projector, has no return although the object has no end there.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.dropouts import dropouts
from abs_service.tracker.detection.segments.depth_segments import Surfaces
from abs_service.tracker.terms.depth.classification.outline_distance import around
from abs_service.tracker.terms.depth.classification.visibility import AGREEMENT_M, MIN_PIXELS
from calib.jit import kernel

#: They are no wider than this share of the mesh's side, if it were square: beyond more of them may be anything.
MAX_WIDTH = 0.5

#: Largest distance from a labelled surface to its outline; interruptions end as far inside theirs [px].
EDGE_PX = 2
_AROUND = np.ones((2 * EDGE_PX + 1, 2 * EDGE_PX + 1))


def interruptions(surfaces: Surfaces, missing: NDArray[np.bool_], expected: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Missing returns (height, width) beyond which, along the row or the column, the object's surface goes on.

    Args:
        surfaces: of the measured distances (height, width), see `surfaces_of`.
        missing: those of the missing returns that may interrupt a surface.
        expected: silhouette of the mesh.
    """
    result = np.zeros(missing.shape, np.bool_)
    if not expected.any():
        return result
    reach = int(MAX_WIDTH * np.sqrt(np.count_nonzero(expected)))
    part = around(expected, reach + EDGE_PX)
    smooth, labels = np.ascontiguousarray(surfaces.smooth[part]), np.ascontiguousarray(surfaces.labels[part])
    ours = np.bincount(labels[expected[part]], minlength=surfaces.count) >= MIN_PIXELS
    ours[0] = False
    between, across = np.zeros(labels.shape, np.bool_), np.zeros(labels.T.shape, np.bool_)
    _fill(smooth, labels, ours, reach, between)
    _fill(np.ascontiguousarray(smooth.T), np.ascontiguousarray(labels.T), ours, reach, across)
    areas = missing[part] & (between | across.T)
    areas &= ~dropouts(areas)  # notches of a ragged outline
    result[part] = missing[part] & (cv2.dilate(areas.view(np.uint8), _AROUND) > 0)
    return result


@kernel
def _fill(
    distance: NDArray[np.float32],
    labels: NDArray[np.int32],
    ours: NDArray[np.bool_],
    reach: int,
    between: NDArray[np.bool_],
) -> None:
    """Marks what lies in a row between two surfaces, at least one of them the object's, that continue each other.

    Args:
        distance, labels: of the image (rows, columns), without much noise.
        ours: True for labels (count,) of the object.
        reach: largest width of a gap [px].
        between: False before (rows, columns).
    """
    for row in range(labels.shape[0]):
        last, of = labels.shape[1], labels[row]  # there is none to the left yet
        for column in range(labels.shape[1]):
            if of[column] == 0:
                continue
            wide = 1 < column - last <= reach and (ours[of[last]] or ours[of[column]])
            if wide and _continues(distance[row], of, last, column):
                between[row, last + 1 : column] = True
            last = column


@kernel
def _continues(distance: NDArray[np.float32], labels: NDArray[np.int32], left: int, right: int) -> bool:
    """True if the surfaces on both sides of a gap, extrapolated across it as far as they are known, meet."""
    width = right - left
    for here, there, back in ((left, right, left - width), (right, left, right + width)):
        expected = distance[here]
        if back >= 0 and back < labels.size and labels[back] == labels[here]:
            expected += distance[here] - distance[back]
        if not abs(distance[there] - expected) < AGREEMENT_M:
            return False
    return True
