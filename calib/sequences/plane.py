"""Plane of a target as q · X = 1 in the sensor's frame: along a unit ray, 1 / r = ray · q."""

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from calib.noise.base import NoiseError

#: RANSAC trials, enough for a plane covering a fifth of the pixels, and pixels that score each.
_TRIALS, _JUDGES = 600, 3000

#: Iterations of reweighted least squares.
_ROUNDS = 12

#: Minimum number of pixels of a plane.
_MIN_PIXELS = 50

#: Cutoff of Tukey's biweight, in units of the tolerance.
_TUKEY = 1.5


def find(
    distance: NDArray[np.floating],
    rays: NDArray[np.floating],
    where: NDArray[np.bool_],
    tolerance: NDArray[np.floating],
    generator: np.random.Generator,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Largest plane q (3,) [1/m] in an image, and its connected pixels (height, width).

    Args:
        distance: radial (height, width) [m].
        rays: unit directions (height, width, 3).
        where: mask of candidate pixels (height, width).
        tolerance: largest distance of a pixel from its plane (height, width) [m].
        generator: draws the triples of pixels.

    Raises:
        NoiseError: there is no plane.
    """
    r, along, t = distance[where], rays[where], tolerance[where]
    if len(r) < _MIN_PIXELS:
        raise NoiseError(f"{len(r)} static pixels are too few for a plane")
    judges = generator.choice(len(r), min(len(r), _JUDGES), replace=False)
    triples = generator.integers(0, len(r), (_TRIALS, 3))
    matrices = along[triples]
    sound = np.abs(np.linalg.det(matrices)) > 1e-9
    if not sound.any():
        raise NoiseError("the static pixels lie on a line")
    planes = np.linalg.solve(matrices[sound], (1 / r[triples[sound]])[..., None])[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        off = np.abs(1 / (planes @ along[judges].T) - r[judges])
    q = planes[np.argmax((off < t[judges]).sum(axis=1))]
    q = _least_squares(q, r, along, t)
    pixels = where & (np.abs(distance - radial(q, rays)) < tolerance)
    labels = np.zeros(where.shape, np.int32)
    scipy.ndimage.label(scipy.ndimage.binary_dilation(pixels, iterations=2), output=labels)
    pixels &= labels == np.argmax(np.bincount(labels[pixels], minlength=1))
    if pixels.sum() < _MIN_PIXELS:
        raise NoiseError("there is no plane in what is static")
    return _least_squares(q, distance[pixels], rays[pixels], tolerance[pixels]), pixels


def through(
    depth: float,
    distance: NDArray[np.floating],
    along: NDArray[np.floating],
    tolerance: NDArray[np.floating],
) -> NDArray[np.float64]:
    """Plane q (3,) [1/m] at a known depth on the optical axis, with fitted orientation.

    A common offset of all pixels does not affect the orientation; one that grows linearly across the image does, and
    cannot be distinguished from a rotated target.

    Args:
        depth: depth of the plane on the optical axis [m].
        distance: radial distances (n,) [m].
        along: unit directions (n, 3).
        tolerance: largest distance of a pixel from the plane, after a common offset (n,) [m].
    """
    q, offset = np.array([0.0, 0.0, 1 / depth]), float(np.median(distance - depth / along[:, 2]))
    for _ in range(_ROUNDS):
        r = 1 / (along @ q)
        residual = distance - r - offset
        weight = _weights(residual, tolerance)
        columns = np.column_stack([-np.square(r)[:, None] * along[:, :2], np.ones(len(r))])
        step = np.linalg.lstsq(columns * weight[:, None], residual * weight, rcond=None)[0]
        q[:2] += step[:2]
        offset += step[2]
    return q


def radial(q: NDArray[np.floating], rays: NDArray[np.floating]) -> NDArray[np.float64]:
    """Radial distances (…,) [m] at which unit directions (…, 3) meet the plane q; NaN if they do not."""
    inverse = np.asarray(rays, np.float64) @ q
    with np.errstate(divide="ignore"):
        return np.where(inverse > 0, 1 / inverse, np.nan)


def _least_squares(
    q: NDArray[np.floating],
    r: NDArray[np.floating],
    along: NDArray[np.floating],
    tolerance: NDArray[np.floating],
) -> NDArray[np.float64]:
    """Robust least squares of distances; 1/r is linear in q, and r − 1/(ray · q) ≈ −r² (1/r − ray · q)."""
    for _ in range(_ROUNDS):
        scale = np.square(r)
        weight = _weights(scale * (along @ q - 1 / r), tolerance) * scale
        q = np.linalg.lstsq(along * weight[:, None], weight / r, rcond=None)[0]
    return np.asarray(q, np.float64)


def _weights(residual: NDArray[np.floating], tolerance: NDArray[np.floating]) -> NDArray[np.float64]:
    """Square roots of Tukey's weights, divided by the tolerance."""
    return np.clip(1 - np.square(residual / (_TUKEY * tolerance)), 0, None) / tolerance
