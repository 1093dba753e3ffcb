"""Markers as OpenCV finds them in an image, the corners between them, and boards of which it shows more than one."""

import cv2
import numpy as np
from cv2.typing import MatLike
from numpy.typing import NDArray

from calib.board.april_grid import BORDER, TAGS, AprilGrid
from calib.board.corners.errors import OtherBoardError
from calib.board.corners.quality import lattice, spacing_px
from calib.board.corners.to_8bit import Grey, scaled, unscaled
from calib.board.target import Charuco

#: Least number of markers that are seen twice; single ones may be misread.
_MIN_REPEATED = 3

#: Factors by which an image with a ChArUco is enlarged, up to a size [px], until its squares are so wide in it [px]. Of
#: smaller ones hardly any markers are read: at 17 px a quarter of the corners is found, and half in an enlarged image.
_SCALES, _MAX_SIDE, _WIDE_SQUARE = (1, 2, 4), 4000, 30.0

#: Least number of different markers of a board that tell its size.
_MIN_READ = 3


def find_markers(
    levels: MatLike, dictionary: cv2.aruco.Dictionary, border: int
) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """Numbers (n,) and corners (n, 4, 2) [px] of markers with frames of a width [cells]."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = border
    corners, ids, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(levels)
    numbers = np.zeros(0, np.intp) if ids is None else ids.ravel().astype(np.intp)
    return numbers, np.array(corners, np.float32).reshape(-1, 4, 2)


def find_charuco(target: Charuco, levels: Grey) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Indices (n,) and pixels (n, 2) of the corners between markers that are read."""
    size = (target.columns, target.rows)
    layout = cv2.aruco.CharucoBoard(size, target.square, target.marker, target.markers(), target.ids())
    layout.setLegacyPattern(target.legacy)
    detector, best = cv2.aruco.CharucoDetector(layout), (np.zeros(0, np.intp), np.zeros((0, 2)))
    for scale in _scales(levels):
        corners, ids, _, _ = detector.detectBoard(scaled(levels, scale))
        if ids is not None and corners is not None and len(ids) > len(best[0]):
            best = ids.ravel().astype(np.intp), unscaled(corners.reshape(-1, 2).astype(np.float64), scale)
        if scale * spacing_px(lattice(target, *best)) > _WIDE_SQUARE or (scale > 1 and not len(best[0])):
            break
    return best


def _scales(levels: Grey) -> list[int]:
    return [each for each in _SCALES if each == 1 or each * max(levels.shape) <= _MAX_SIDE]


def _kind(target: Charuco | AprilGrid) -> tuple[cv2.aruco.Dictionary, int]:
    """Dictionary and width of the frame [cells]."""
    return (TAGS, BORDER) if isinstance(target, AprilGrid) else (target.markers(), 1)


def cell_px(target: Charuco | AprilGrid, levels: Grey) -> float:
    """Width of the cells of a board's markers [px]; NaN if too few can be read to tell."""
    ids = np.arange(target.columns * target.rows) if isinstance(target, AprilGrid) else target.ids()
    (dictionary, border), scale = _kind(target), _scales(levels)[-1]
    numbers, corners = find_markers(scaled(levels, scale), dictionary, border)
    if len(np.intersect1d(numbers, ids)) < _MIN_READ:
        return np.nan
    sides = np.linalg.norm(np.diff(corners[np.isin(numbers, ids)], axis=1), axis=2)
    return float(np.median(sides)) / scale / (dictionary.markerSize + 2 * border)


def require_one_board(target: Charuco | AprilGrid, levels: Grey) -> None:
    """Checks that an image shows no second board with the same markers: of both together there is no pose.

    Raises:
        OtherBoardError: some markers are there twice.
    """
    _, counts = np.unique(find_markers(levels, *_kind(target))[0], return_counts=True)
    if np.sum(counts > 1) >= _MIN_REPEATED:
        raise OtherBoardError(
            "more than one board with these markers is in the image: put the others away, such as a second print or a "
            "screen that shows it"
        )
