"""The plane with most returns of a depth image, such as a table or a wall, and what is above it."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.depth_view import DepthView
from abs_service.tracker.detection.initial_detection import DetectionError
from calib.noise.base import NoiseError
from calib.sequences import plane

#: Minimum share of the returns on a plane for it to be what the object lies on.
MIN_SHARE = 0.2

#: Height above the plane up to which a pixel belongs to it by default [m].
CLEARANCE_M = 0.01

#: Number of pixels of the subsampled image in which the plane is found; more are slower but not more accurate.
MAX_PIXELS = 20_000


def above_plane(view: DepthView, clearance_m: float) -> NDArray[np.bool_]:
    """Pixels (height, width) above the dominant plane, see `heights_above_plane`."""
    with np.errstate(invalid="ignore"):
        return heights_above_plane(view, clearance_m) > clearance_m


def heights_above_plane(view: DepthView, clearance_m: float) -> NDArray[np.float64]:
    """Heights (height, width) above the dominant plane, towards the camera's side [m]; NaN without return.

    The random generator is seeded, so that the same image has the same plane.

    Args:
        view: the depth image.
        clearance_m: height up to which a pixel belongs to the plane [m].

    Raises:
        DetectionError: no plane has `MIN_SHARE` of the returns.
    """
    q = _dominant_plane(view, clearance_m)
    points_s = view.camera.rays() * view.distance[..., None]
    height = (1 - points_s @ q) / np.linalg.norm(q)
    with np.errstate(invalid="ignore"):
        share = np.count_nonzero(np.abs(height) <= clearance_m) / np.count_nonzero(view.measured)
    if share < MIN_SHARE:
        raise DetectionError(
            f"no plane: the largest has {share:.0%} of the returns within clearance_m = {clearance_m:g} m, "
            f"{MIN_SHARE:.0%} needed"
        )
    return height


def _dominant_plane(view: DepthView, tolerance: float) -> NDArray[np.float64]:
    """The plane q (3,) [1/m] with the most pixels within a tolerance [m]: q · X = 1 in the sensor's frame.

    Raises:
        DetectionError: there is no plane.
    """
    step = int(np.ceil(np.sqrt(view.distance.size / MAX_PIXELS)))
    distance, rays = view.distance[::step, ::step], view.camera.rays()[::step, ::step]
    tolerances = np.full(distance.shape, tolerance)
    try:
        return plane.find(distance, rays, np.isfinite(distance), tolerances, np.random.default_rng(0))[0]
    except NoiseError:
        raise DetectionError(f"no plane: too few returns within clearance_m = {tolerance:g} m of one") from None
