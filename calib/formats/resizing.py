"""A camera for images of another size."""

import numpy as np

from calib.camera import Camera


def resized(one: Camera, width: int, height: int) -> Camera:
    """The camera of an image of another size, as the device makes it: scaled until it fills the new one, then cropped.

    The edges of the image are half a pixel outside of the outermost centres, so centres move by half a pixel less than
    they are scaled.
    """
    scale = max(width / one.width, height / one.height)
    cropped = np.array([one.width * scale - width, one.height * scale - height]) / 2
    cx, cy = (np.array([one.cx, one.cy]) + 0.5) * scale - 0.5 - cropped
    return Camera(width, height, one.fx * scale, one.fy * scale, float(cx), float(cy), one.lens, one.T_rs)
