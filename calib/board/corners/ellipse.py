"""Bias of a disc's image under perspective: the centre of the ellipse is not the image of the disc's centre."""

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.board.target import AsymmetricCircles, Circles


def center_bias(
    target: Circles | AsymmetricCircles, ids: NDArray[np.intp], pixels: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Centre of each disc's image minus the image of its centre (n, 2) [px].

    A disc of radius r about (x, y) is the conic (X − x)² + (Y − y)² = r² with the dual Q. A homography H of the board's
    plane maps it to H Q Hᵀ, whose centre is the last column over its last element (J. Heikkilä, PAMI 2000). Lens
    distortion adds terms of higher order in the disc's size, which are neglected.
    """
    board = target.points()[ids, :2]
    H, _ = cv2.findHomography(board, pixels)
    if H is None:
        return np.zeros_like(pixels)
    centers = np.concatenate([board, np.ones((len(board), 1))], axis=1)
    # The dual conic is c cᵀ − r² diag(1, 1, 0), up to a factor.
    round_part = H @ np.diag([1.0, 1.0, 0.0]) @ H.T * (target.diameter / 2) ** 2
    images = centers @ H.T
    dual = images[:, :, None] * images[:, None, :] - round_part
    return dual[:, :2, 2] / dual[:, 2:, 2] - images[:, :2] / images[:, 2:]
