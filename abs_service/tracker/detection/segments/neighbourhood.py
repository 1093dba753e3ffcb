"""Pixels around those of a mask."""

import cv2
import numpy as np
from numpy.typing import NDArray


def grown(mask: NDArray[np.bool_], reach_px: int) -> NDArray[np.bool_]:
    """Pixels (rows, columns) within so many rows and columns of those of a mask."""
    return cv2.dilate(mask.view(np.uint8), square(reach_px)) > 0


def square(reach_px: int) -> NDArray[np.uint8]:
    """A square that reaches so many pixels to all sides of its middle."""
    return np.ones((2 * reach_px + 1, 2 * reach_px + 1), np.uint8)
