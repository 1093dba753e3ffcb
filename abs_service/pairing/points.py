"""Depth images in other forms: along the optical axis, and as points."""

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.observation import check_size
from calib.camera import Camera
from drivers.contract.frame import Frame, Geometry


def z_image(depth: Frame, camera: Camera) -> NDArray[np.float32]:
    """Distances along the optical axis (height, width) [m] of a depth frame, NaN without return.

    As measured: the systematic error in `[sensors.NAME.depth]` is not taken off.

    Args:
        depth: a frame that holds radial distances or z.
        camera: of its sensor.

    Raises:
        ObservationError: the camera is for images of another size.
        LensError: the camera's lens has no inverse somewhere on the image.
    """
    check_size(depth, camera)
    lengths = depth.si()
    return lengths / camera.lookup.ray_length.astype(np.float32) if depth.geometry == Geometry.RADIAL else lengths


def points_s(z: NDArray[np.float32], camera: Camera) -> NDArray[np.float32]:
    """Points (height, width, 3) [m] in the sensor's frame of an image of z [m]; NaN stays NaN.

    Raises:
        LensError: the camera's lens has no inverse somewhere on the image.
    """
    points = np.empty((*z.shape, 3), np.float32)
    np.multiply(camera.lookup.ideal, z[..., None], out=points[..., :2], casting="same_kind")
    points[..., 2] = z
    return points
