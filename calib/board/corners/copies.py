"""Boards with markers of which an image shows more than one copy."""

import cv2
import numpy as np

from calib.board.april_grid import BORDER, TAGS, AprilGrid
from calib.board.corners.errors import OtherBoardError
from calib.board.corners.to_8bit import Grey
from calib.board.target import Charuco

#: Least number of markers that are seen twice; single ones may be misread.
_LEAST = 3


def require_one_board(target: Charuco | AprilGrid, levels: Grey) -> None:
    """Checks that an image shows no second board with the same markers: of both together there is no pose.

    Raises:
        OtherBoardError: some markers are there twice.
    """
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = BORDER if isinstance(target, AprilGrid) else 1
    dictionary = TAGS if isinstance(target, AprilGrid) else target.markers()
    _, found, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(levels)
    _, counts = np.unique([] if found is None else found, return_counts=True)
    if np.sum(counts > 1) >= _LEAST:
        raise OtherBoardError(
            "more than one board with these markers is in the image: put the others away, such as a second print or a "
            "screen that shows it"
        )
