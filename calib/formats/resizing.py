"""Conversion of a camera to another image size."""

import numpy as np

from calib.camera import Camera


def resized(one: Camera, width: int, height: int) -> Camera:
    """Camera of an image of another size, as devices make it: scaled to fill the new size, then cropped.

    The image's edges are half a pixel outside the outermost pixel centres, so the principal point is scaled about the
    corner and not about the first pixel's centre.
    """
    scale = max(width / one.width, height / one.height)
    cropped = np.array([one.width * scale - width, one.height * scale - height]) / 2
    cx, cy = (np.array([one.cx, one.cy]) + 0.5) * scale - 0.5 - cropped
    return Camera(width, height, one.fx * scale, one.fy * scale, float(cx), float(cy), one.lens, one.T_rs)
