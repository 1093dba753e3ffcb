"""Markers as OpenCV finds them in an image, and boards of which it shows more than one copy."""

import cv2
import numpy as np
from cv2.typing import MatLike
from numpy.typing import NDArray

from calib.board.april_grid import BORDER, TAGS, AprilGrid
from calib.board.corners.errors import OtherBoardError
from calib.board.corners.to_8bit import Grey
from calib.board.target import Charuco

#: Least number of markers that are seen twice; single ones may be misread.
_MIN_REPEATED = 3


def find_markers(
    levels: MatLike, dictionary: cv2.aruco.Dictionary, border: int
) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """Numbers (n,) and corners (n, 4, 2) [px] of markers with frames of a width [cells]."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = border
    corners, ids, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(levels)
    numbers = np.zeros(0, np.intp) if ids is None else ids.ravel().astype(np.intp)
    return numbers, np.array(corners, np.float32).reshape(-1, 4, 2)


def require_one_board(target: Charuco | AprilGrid, levels: Grey) -> None:
    """Checks that an image shows no second board with the same markers: of both together there is no pose.

    Raises:
        OtherBoardError: some markers are there twice.
    """
    kind = (TAGS, BORDER) if isinstance(target, AprilGrid) else (target.markers(), 1)
    _, counts = np.unique(find_markers(levels, *kind)[0], return_counts=True)
    if np.sum(counts > 1) >= _MIN_REPEATED:
        raise OtherBoardError(
            "more than one board with these markers is in the image: put the others away, such as a second print or a "
            "screen that shows it"
        )
