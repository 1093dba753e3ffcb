"""Round sides: a surface that turns away from the sensor ends in a silhouette, which wanders over it as it turns.

The normals of a mesh are too coarse for it: its outermost vertices lie up to a cell inside. The distances are not.
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.terms.depth.outline.rim import read
from calib.camera import Camera

#: Distances inside the outline at which a surface is measured [px], in three groups. Nearer, pixels are mixed ones.
_DEPTHS_PX = np.array([[2.0, 2.5, 3.0], [4.5, 5.0, 5.5], [8.0, 9.0, 10.0]])

#: So far along the outline, the distances beside an edge are averaged [px].
_ALONG_PX = np.array([-6.0, -3.0, 0.0, 3.0, 6.0])

#: A side is round where its sine at the outline is beyond the first (72°), and from there as far as it is beyond the
#: second (58°), if that in the image is beyond the third. A sheet may be bent by as much as the second at its edge.
_CERTAIN_SINE, _GROWING_SINE, _MIN_MEASURED = 0.95, 0.85, 0.65

#: Number of neighbouring edges, of which the median counts; and of those that a round one among them makes round: where
#: an end meets a silhouette, its corner wanders as well.
_NEIGHBOURS, _BESIDE = 7, 5

#: A body that turns away at so many edges as `_BESIDE` does so along its whole side, and on the opposite one: edges
#: that face the same way or against it, up to 45°, are round as the cosine tells, if they are measured to be steep.
_PARALLEL = 0.7


def is_round_side(
    camera: Camera,
    distance: NDArray[np.float32],
    places: NDArray[np.float64],
    inside: NDArray[np.float64],
    gradients: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """True for edges (k,) beside which the measured surface turns away from the sensor, up to a silhouette.

    The sine of the angle between the surface and a plane across the line of sight is linear in the distance from the
    outline on a cylinder, 1 at its silhouette: so it is extrapolated from two places to the outline.

    Args:
        camera: the depth camera.
        distance: measured radial distances (height, width) [m], NaN without return.
        places: the edges in the image (k, 2) [px].
        inside: their distances inside the outline (k,) [px].
        gradients: image gradients of these (k, 2).
    """
    if not len(places):
        return np.zeros(0, np.bool_)
    inwards = gradients / np.maximum(np.linalg.norm(gradients, axis=1), np.finfo(float).tiny)[:, None]
    along = inwards @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    ends = (places - inside[:, None] * inwards)[:, None] + _ALONG_PX[:, None] * along[:, None]
    at = (ends[:, None, None] + _DEPTHS_PX[..., None, None] * inwards[:, None, None, None]).reshape(-1, 2)
    measured = read(distance, np.zeros(2, np.float32), at, (camera.width - 1, camera.height - 1))
    logarithm = np.log(np.where(np.isfinite(measured), measured, np.nan))
    logarithm = _median(logarithm.reshape(len(places), len(_DEPTHS_PX), -1))
    centers = _DEPTHS_PX.mean(axis=1)
    near_by = _nearest(places, _NEIGHBOURS)
    slopes = _smoothed(-np.diff(logarithm, axis=1) * camera.fx / np.diff(centers), near_by)
    near, far = (slopes / np.hypot(1.0, slopes)).T
    at_near, at_far = (centers[1:] + centers[:-1]) / 2
    extrapolated = near + (near - far) * at_near / (at_far - at_near)
    both = _smoothed(np.stack([near, extrapolated], axis=1), near_by)
    is_steep = both[:, 0] > _MIN_MEASURED
    may_be = is_steep & (both[:, 1] > _GROWING_SINE)
    is_round, beside = may_be & (both[:, 1] > _CERTAIN_SINE), near_by[:, :_BESIDE]
    for _ in places:
        is_round |= may_be & is_round[beside].any(axis=1)
    parallel = np.abs(inwards @ inwards[is_round].T) > _PARALLEL
    is_round |= is_steep & (np.count_nonzero(parallel, axis=1) >= _BESIDE)
    return np.asarray(is_round[beside].any(axis=1))


def _smoothed(values: NDArray[np.float64], near_by: NDArray[np.intp]) -> NDArray[np.float64]:
    """Medians of the values (k, m) of the edges near each (k, count), see `_median`."""
    return _median(values[near_by].swapaxes(1, 2))


def _nearest(places: NDArray[np.float64], count: int) -> NDArray[np.intp]:
    """Indices (k, count) of the places (k, 2) that are nearest to each of them, itself first."""
    apart = np.linalg.norm(places[:, None] - places, axis=2)
    return np.argsort(apart, axis=1, kind="stable")[:, :count]


def _median(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Medians (…,) of the known of the last axis; unknown where most are."""
    unknown = np.isnan(values).mean(axis=-1) > 1 / 2
    return np.where(unknown, np.nan, np.nanmedian(np.where(unknown[..., None], 0.0, values), axis=-1))
