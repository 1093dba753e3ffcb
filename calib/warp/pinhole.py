"""A camera without distortion that sees all that another one sees, and where its pixels are in the other's image."""

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera

#: The image of the camera without distortion is at most so many times as wide and as high as the original.
MOST_GROWTH = 2.0


def pinhole_of(camera: Camera) -> Camera:
    """The pinhole at the same place, with the same focal lengths, whose image covers the camera's field of view.

    On the axis, where the lens does not distort, pixels of both have the same centres. Otherwise the nearest pixel
    would be off by the same part of a pixel all over the middle of the image: a shift of the surface.

    Where a wide lens would need more than twice the size, the rim is left out.
    """
    if camera.lens.is_pinhole:
        return camera
    ideal = camera.lookup.ideal.reshape(-1, 2) * (camera.fx, camera.fy)
    half = np.array([camera.width, camera.height]) * MOST_GROWTH / 2
    low, high = np.maximum(ideal.min(axis=0), -half), np.minimum(ideal.max(axis=0), half)
    center = np.array([camera.cx, camera.cy])
    axis = center + np.ceil(-low - center - 1e-6)
    width, height = (np.ceil(high + axis - 1e-6).astype(int) + 1).tolist()
    return Camera(width, height, camera.fx, camera.fy, *axis.tolist(), T_rs=camera.T_rs)


def resampling(pinhole: Camera, camera: Camera) -> NDArray[np.int32]:
    """For every pixel of a pinhole with the same centre, the nearest one of the camera: the backward distortion.

    Returns:
        Indices (height + 2, width + 2) into the camera's flattened image with a border of one pixel, 0 where the camera
        sees nothing; the result has a border as well.
    """
    ideal = pinhole.lookup.ideal
    place = camera.lens.distort(ideal) * (camera.fx, camera.fy) + (camera.cx, camera.cy)
    pixel = np.floor(place + 0.5)
    inside = np.all((pixel >= 0) & (pixel < (camera.width, camera.height)), axis=-1)
    inside &= np.linalg.norm(ideal, axis=-1) < camera.field_radius  # beyond, the polynomial may fold back
    column, row = np.where(inside[..., None], pixel, -1).astype(np.int32).transpose(2, 0, 1)
    return np.pad((row + 1) * (camera.width + 2) + column + 1, 1).astype(np.int32) * np.pad(inside, 1)
