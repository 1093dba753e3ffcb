"""Raw detection of the tags of an AprilGrid by OpenCV."""

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.board.april_grid import BORDER, TAGS, AprilGrid
from calib.board.corners.markers import find_markers
from calib.board.corners.to_8bit import Grey

#: Factors by which the image is enlarged, and widths by which white grows, of every attempt. Black squares touch the
#: tags, which hides their outlines or cuts corners off: each of these separates some that the others do not.
_ATTEMPTS = ((2, 1), (2, 2), (1, 1), (1, 2))

#: Half width of the area in which a corner is looked for, relative to the tag; OpenCV's outlines cut corners off.
_AROUND = 0.12
_CRITERIA = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.01)


def find_april_grid(target: AprilGrid, levels: Grey) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Indices (n,) and pixels (n, 2) of the corners of tags, each from the first attempt that comes close to it."""
    pixels = np.full((len(target.points()), 2), np.nan)
    for enlarged, grown in _ATTEMPTS:
        for number, corners in _tags(levels, enlarged, grown).items():
            if number < target.columns * target.rows:
                ids = target.ids_of_tag(number)
                pixels[ids] = np.where(np.isnan(pixels[ids]), _at_the_corners(levels, corners), pixels[ids])
    ids = np.flatnonzero(np.isfinite(pixels).all(axis=1))
    return ids, pixels[ids]


def _tags(levels: Grey, enlarged: int, grown: int) -> dict[int, NDArray[np.float64]]:
    """Corners (4, 2) [px] of the detected tags by their number."""
    image = levels
    if enlarged > 1:
        image = cv2.resize(levels, None, fx=enlarged, fy=enlarged, interpolation=cv2.INTER_CUBIC)
    if grown > 1:
        image = cv2.dilate(image, np.ones((grown, grown), np.uint8))
    numbers, corners = find_markers(image, TAGS, BORDER)
    return dict(zip(numbers.tolist(), (corners.astype(np.float64) + 0.5) / enlarged - 0.5, strict=True))


def _at_the_corners(levels: Grey, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners (4, 2) where edges meet; NaN where none do, as on a tag that is partly hidden."""
    size = np.linalg.norm(np.diff(corners, axis=0), axis=1).min()
    half = max(2, round(_AROUND * float(size)))
    first = np.ascontiguousarray(corners.reshape(4, 1, 2), np.float32)
    found = cv2.cornerSubPix(levels, first.copy(), (half, half), (-1, -1), _CRITERIA)
    is_lost = (found == first).all(axis=2)  # OpenCV's answer if the corner is further away
    return np.where(is_lost, np.nan, found[:, 0]).astype(np.float64)
