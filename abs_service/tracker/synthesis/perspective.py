"""Projection of points into one camera's image, and its derivatives, in double precision."""

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.jit import kernel
from calib.lenses.lens import Lens

#: Edges shorter than this in the image [px], of a surface seen at grazing incidence, are down-weighted.
SHORT_EDGE_PX = 0.5


def project_with_jacobian(
    camera: Camera, points: NDArray[np.floating]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """`Camera.project` and `Camera.projection_jacobian` in one pass, compiled for the common lenses.

    Args:
        camera: the camera.
        points: (n, 3) in the rig's frame [m].

    Returns:
        Pixel coordinates (n, 2), NaN at or behind the camera plane, and their Jacobian with respect to the points
        (n, 2, 3) [px/m].
    """
    if not isinstance(camera.lens, Lens):
        return camera.project(points), camera.projection_jacobian(points)
    places, jacobian = np.empty((len(points), 2)), np.empty((len(points), 2, 3))
    matrix = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    points = np.ascontiguousarray(points, np.float64)
    _project(points, camera.T_sr, matrix, camera.lens.coefficients, places, jacobian)
    return places, jacobian


def image_gradients(
    camera: Camera,
    vertices: NDArray[np.floating],
    edges: NDArray[np.int32],
    lengths: NDArray[np.float64],
    per_metre: NDArray[np.float64],
) -> NDArray[np.float32]:
    """Gradients of attributes in the image (n, channels, 2) [1/px], right and down, at every vertex.

    Args:
        camera: the camera.
        vertices: (n, 3) [m].
        edges: (k, 2); the edges around a vertex give the directions of its tangents in the image.
        lengths: components of every edge along the tangents at both its ends (2, k, 2) [m].
        per_metre: gradients along the tangents (n, channels, 2) [1/m].
    """
    places, _ = project_with_jacobian(camera, vertices)
    result = np.empty(per_metre.shape, np.float32)
    _regress(places, edges, lengths, per_metre, result)
    return result


@kernel
def _project(
    points: NDArray[np.float64],
    pose: NDArray[np.float64],
    matrix: NDArray[np.float64],
    lens: NDArray[np.float64],
    places: NDArray[np.float64],
    jacobian: NDArray[np.float64],
) -> None:
    """Eq. 10 and its derivatives, see `Lens.distort` and `Lens.jacobian`; pose (4, 4) = T_sr."""
    fx, fy, cx, cy = matrix
    k1, k2, p1, p2, k3, k4, k5, k6 = lens
    for v in range(points.shape[0]):
        a, b, c = points[v, 0], points[v, 1], points[v, 2]
        z = pose[2, 0] * a + pose[2, 1] * b + pose[2, 2] * c + pose[2, 3]
        inverse = 1 / z if z > 0 else np.nan
        x = (pose[0, 0] * a + pose[0, 1] * b + pose[0, 2] * c + pose[0, 3]) * inverse
        y = (pose[1, 0] * a + pose[1, 1] * b + pose[1, 2] * c + pose[1, 3]) * inverse
        r2 = x * x + y * y
        below = 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
        radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / below
        slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3) - radial * (k4 + r2 * (2 * k5 + r2 * 3 * k6))) / below
        places[v, 0] = fx * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + cx
        places[v, 1] = fy * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + cy
        along_x = fx * (radial + x * x * slope + 2 * p1 * y + 6 * p2 * x) * inverse
        along_y = fy * (radial + y * y * slope + 6 * p1 * y + 2 * p2 * x) * inverse
        mixed = (x * y * slope + 2 * p1 * x + 2 * p2 * y) * inverse
        back_u, back_v = -(along_x * x + fx * mixed * y), -(fy * mixed * x + along_y * y)
        for i in range(3):
            jacobian[v, 0, i] = along_x * pose[0, i] + fx * mixed * pose[1, i] + back_u * pose[2, i]
            jacobian[v, 1, i] = fy * mixed * pose[0, i] + along_y * pose[1, i] + back_v * pose[2, i]


@kernel
def _regress(
    place: NDArray[np.float64],
    edges: NDArray[np.int32],
    lengths: NDArray[np.float64],
    per_metre: NDArray[np.float64],
    result: NDArray[np.float32],
) -> None:
    """See `image_gradients`; places (n, 2) are NaN where unknown. `SHORT_EDGE_PX` regularises towards zero."""
    sums = np.zeros((place.shape[0], 7))
    for e in range(edges.shape[0]):
        u = place[edges[e, 1], 0] - place[edges[e, 0], 0]
        v = place[edges[e, 1], 1] - place[edges[e, 0], 1]
        if np.isnan(u) or np.isnan(v):
            continue
        for end in range(2):
            total, first, second = sums[edges[e, end]], lengths[end, e, 0], lengths[end, e, 1]
            total[0] += u * u
            total[1] += u * v
            total[2] += v * v
            total[3] += first * u
            total[4] += first * v
            total[5] += second * u
            total[6] += second * v
    least = SHORT_EDGE_PX**2
    for n in range(place.shape[0]):
        a, b, d = sums[n, 0] + least, sums[n, 1], sums[n, 2] + least
        determinant = a * d - b * b
        for channel in range(per_metre.shape[1]):
            first, second = per_metre[n, channel]
            x, y = first * sums[n, 3] + second * sums[n, 5], first * sums[n, 4] + second * sums[n, 6]
            result[n, channel, 0] = (x * d - y * b) / determinant
            result[n, channel, 1] = (y * a - x * b) / determinant
