"""Undistorted camera with the field of view of another camera, and the resampling between both."""

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera

#: Largest size of the undistorted image relative to the original.
MAX_GROWTH = 2.0


def pinhole_of(camera: Camera) -> Camera:
    """Pinhole camera with the same centre and focal lengths, whose image covers the camera's field of view.

    On the optical axis, where distortion vanishes, pixel centres of both coincide. Otherwise nearest-neighbour sampling
    would shift the middle of the image by a fraction of a pixel. For wide lenses the image is limited to twice the
    size.
    """
    if camera.lens.is_pinhole:
        return camera
    ideal = camera.lookup.ideal.reshape(-1, 2) * (camera.fx, camera.fy)
    half = np.array([camera.width, camera.height]) * MAX_GROWTH / 2
    low, high = np.maximum(ideal.min(axis=0), -half), np.minimum(ideal.max(axis=0), half)
    center = np.array([camera.cx, camera.cy])
    axis = center + np.ceil(-low - center - 1e-6)
    width, height = (np.ceil(high + axis - 1e-6).astype(int) + 1).tolist()
    return Camera(width, height, camera.fx, camera.fy, *axis.tolist(), T_rs=camera.T_rs)


def resampling(pinhole: Camera, camera: Camera) -> NDArray[np.int32]:
    """Nearest pixel of the camera for every pixel of a concentric pinhole: backward distortion.

    Returns:
        Indices (height + 2, width + 2) into the camera's flattened image with a border of one pixel, 0 outside its
        view; the result has a border as well.
    """
    ideal = pinhole.lookup.ideal
    place = camera.lens.distort(ideal) * (camera.fx, camera.fy) + (camera.cx, camera.cy)
    pixel = np.floor(place + 0.5)
    inside = np.all((pixel >= 0) & (pixel < (camera.width, camera.height)), axis=-1)
    inside &= np.linalg.norm(ideal, axis=-1) < camera.field_radius  # beyond, the polynomial may fold back
    column, row = np.where(inside[..., None], pixel, -1).astype(np.int32).transpose(2, 0, 1)
    return np.pad((row + 1) * (camera.width + 2) + column + 1, 1).astype(np.int32) * np.pad(inside, 1)
