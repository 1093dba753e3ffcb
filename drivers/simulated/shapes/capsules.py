"""Ray casting kernels for capsules (segments with a radius), which form a hand.

Closed-form, and independent of the tracker's models. A capsule is a row (x, y, z of its first end, x, y, z of the
vector to its other end, radius) [m], relative to the rays' origin.
"""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel

#: Tolerance of the shadow test, so that a capsule does not shadow its own lit side [m].
_CLEARANCE = 2e-3


@kernel
def closest_approach(
    x: float, y: float, z: float, ax: float, ay: float, az: float, bx: float, by: float, bz: float
) -> tuple[float, float]:
    """Closest approach of the ray in unit direction (x, y, z) to the segment from a to a + b.

    In the projection along the ray, the segment's point closest to the origin is at the fraction s of its length.

    Returns:
        (distance along the ray [m], distance of the ray from the segment [m]).
    """
    along_a, along_b = ax * x + ay * y + az * z, bx * x + by * y + bz * z
    across = bx * bx + by * by + bz * bz - along_b * along_b
    s = (along_a * along_b - (ax * bx + ay * by + az * bz)) / across if across > 1e-18 else 0.0
    s = min(max(s, 0.0), 1.0)
    px, py, pz = ax + s * bx, ay + s * by, az + s * bz
    along = along_a + s * along_b
    return along, np.sqrt(max(px * px + py * py + pz * pz - along * along, 0.0))


@kernel
def intersect_capsule(
    x: float, y: float, z: float, ax: float, ay: float, az: float, bx: float, by: float, bz: float, radius: float
) -> float:
    """Distance [m] at which the ray in unit direction (x, y, z) enters a capsule; NaN for a miss.

    Intersection with the infinite cylinder A λ² + 2 B λ + C = 0; beyond an end, with the sphere at that end.
    """
    long = bx * bx + by * by + bz * bz
    along_a, along_b, ab = ax * x + ay * y + az * z, bx * x + by * y + bz * z, ax * bx + ay * by + az * bz
    square = ax * ax + ay * ay + az * az
    A = long - along_b * along_b
    B = along_b * ab - long * along_a
    C = long * square - ab * ab - radius * radius * long
    discriminant = B * B - A * C
    if discriminant < 0:
        return np.nan
    distance = (-B - np.sqrt(discriminant)) / A if A > 1e-18 else 0.0
    place = distance * along_b - ab  # of the point of entry, from 0 at the first end to `long` at the other
    if A > 1e-18 and 0 <= place <= long:
        return distance
    if (A > 1e-18 and place > long) or (A <= 1e-18 and along_b < 0):
        along_a, square = along_a + along_b, square + 2 * ab + long
    discriminant = along_a * along_a - square + radius * radius
    return along_a - np.sqrt(discriminant) if discriminant >= 0 else np.nan


@kernel
def cast_capsules(
    rays: NDArray[np.float64], capsules: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32], NDArray[np.int8]]:
    """Casts the ray of every pixel at capsules.

    The coverage of a pixel at a rim is that of a straight edge at the same distance from the pixel's centre.

    Args:
        rays: unit directions in the sensor frame, (height, width, 3).
        capsules: (n, 7), relative to the camera centre in the sensor frame [m].

    Returns:
        (share, radial distance [m], cosine of incidence, index of the capsule), each (height, width); 0, NaN, NaN and
        -1 for a miss. If only the centre misses, the distance is that of the closest approach.
    """
    height, width = rays.shape[:2]
    share = np.zeros((height, width), np.float32)
    distance, cosine = np.full((height, width), np.nan, np.float32), np.full((height, width), np.nan, np.float32)
    part = np.full((height, width), -1, np.int8)
    cones = _cones(capsules)
    for row in range(height):
        for column in range(width):
            x, y, z = rays[row, column, 0], rays[row, column, 1], rays[row, column, 2]
            beside = rays[row, column + 1 if column + 1 < width else max(column - 1, 0)]
            pixel = np.sqrt((beside[0] - x) ** 2 + (beside[1] - y) ** 2 + (beside[2] - z) ** 2)
            best, nearest = 0.0, np.inf
            for i in range(len(capsules)):
                if cones[i, 0] * x + cones[i, 1] * y + cones[i, 2] * z < cones[i, 3] - pixel:
                    continue
                ax, ay, az, bx, by, bz, radius = capsules[i]
                along, miss = closest_approach(x, y, z, ax, ay, az, bx, by, bz)
                if along <= 0 or miss > radius + 0.5 * pixel * along:
                    continue
                covered = min(0.5 + (radius - miss) / (pixel * along), 1.0)
                found = intersect_capsule(x, y, z, ax, ay, az, bx, by, bz, radius)
                entry = along if np.isnan(found) else found
                if (covered >= 0.5 and entry < nearest) or (best < 0.5 and covered > best):
                    nearest = entry if covered >= 0.5 else np.inf
                    px, py, pz = entry * x - ax, entry * y - ay, entry * z - az
                    s = (px * bx + py * by + pz * bz) / max(bx * bx + by * by + bz * bz, 1e-18)
                    s = min(max(s, 0.0), 1.0)
                    outward = (px - s * bx) * x + (py - s * by) * y + (pz - s * bz) * z
                    distance[row, column], part[row, column] = entry, i
                    cosine[row, column] = 0.0 if np.isnan(found) else max(-outward / radius, 0.0)
                best = max(best, covered)
            share[row, column] = best
    return share, distance, cosine, part


@kernel
def shadowed_by_capsules(
    points: NDArray[np.float64], light: NDArray[np.float64], capsules: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Shadow mask of points (height, width, 3): True where capsules (n, 7), relative to the light, block the light."""
    height, width = points.shape[:2]
    dark = np.zeros((height, width), np.bool_)
    for row in range(height):
        for column in range(width):
            x = points[row, column, 0] - light[0]
            y, z = points[row, column, 1] - light[1], points[row, column, 2] - light[2]
            length = np.sqrt(x * x + y * y + z * z)
            for i in range(len(capsules)):
                ax, ay, az, bx, by, bz, radius = capsules[i]
                found = intersect_capsule(x / length, y / length, z / length, ax, ay, az, bx, by, bz, radius)
                if 0 < found < length - _CLEARANCE:
                    dark[row, column] = True
                    break
    return dark


@kernel
def _cones(capsules: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bounding cone of each capsule: axis (x, y, z) and cosine of the half angle."""
    cones = np.empty((len(capsules), 4))
    for i in range(len(capsules)):
        middle = capsules[i, 0:3] + 0.5 * capsules[i, 3:6]
        reach = 0.5 * np.sqrt((capsules[i, 3:6] ** 2).sum()) + capsules[i, 6]
        away = np.sqrt((middle**2).sum())
        for j in range(3):
            cones[i, j] = middle[j] / away
        cones[i, 3] = np.sqrt(1 - (reach / away) ** 2) if reach < away else -1.0
    return cones
