"""Images of discs: their centres of area, and why these are not the images of the discs' centres."""

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.board.corners.to_8bit import Grey
from calib.board.target import AsymmetricCircles, Circles

#: Largest degree of the polynomials that describe what a homography leaves, and least number of discs for each
#: coefficient of one coordinate.
_DEGREE, _FOR_EACH = 4, 3

#: Number of points on the rim of a disc.
_RIM = 32

#: Area of a disc that is surely black, in radii, and of what is around it, in parts of the way to the next disc.
_BLACK, _WHITE, _AROUND = 0.6, 0.15, 0.3

#: Discs beside another one are as far away at most, in distances to the next.
_BESIDE = 1.6

#: Least radius of a disc that is black across many pixels, which noise can tear apart; the edges of others say all.
_LARGE_PX = 6.0

#: Darkness from which on a pixel counts, in deviations on black and white, and its range; as much below 1, it counts
#: fully.
_NOISE, _MIN_DARKNESS = 4.0, (0.1, 0.35)

#: Largest tone of a disc, as part of the white around it, and largest distance of its centre from the one found, in
#: radii.
_DARK, _MOVED = 0.8, 0.3

Array = NDArray[np.float64]


def centers(target: Circles | AsymmetricCircles, ids: NDArray[np.intp], pixels: Array, levels: Grey) -> Array:
    """Centres of area of discs (n, 2) [px], from those that a search found (n, 2).

    A search by thresholds takes noise on black for parts of discs, which moved centres by up to 0.8 px. Here pixels
    count by how dark they are beside the black and the white of their own disc; what is nearly one of these is it.
    """
    points, found, radius = target.points()[ids, :2], pixels.copy(), target.diameter / 2
    away = np.linalg.norm(points[:, None] - points, axis=2) / radius
    to_next = np.partition(away, 1, axis=1)[:, 1].min()
    white, around = (1 + share * (to_next - 2) for share in (_WHITE, _AROUND))
    for index, distances in enumerate(away):
        beside = distances < _BESIDE * to_next  # through a fisheye, only those tell how large a disc is
        along, _, rank, _ = np.linalg.lstsq(points[beside] - points[index], pixels[beside] - pixels[index], rcond=None)
        if rank == len(along):
            found[index] = _center(levels, pixels[index], radius * along.T, white, around)
    return found


def _center(levels: Grey, start: Array, axes: Array, white: float, around: float) -> Array:
    """Centre of one disc (2,), whose radii along the board are `axes` (2, 2) [px]; `start` if unknown."""
    if np.linalg.svd(axes, compute_uv=False)[-1] < _LARGE_PX:
        return start
    reach = np.ceil(around * np.linalg.norm(axes, axis=1)) + 1
    low = np.maximum(np.floor(start - reach), 0).astype(int)
    high = np.minimum(np.ceil(start + reach) + 1, levels.shape[::-1]).astype(int)
    rows, columns = np.mgrid[low[1] : high[1], low[0] : high[0]]
    places = np.stack([columns.ravel(), rows.ravel()], axis=1) - start
    tones = levels[low[1] : high[1], low[0] : high[0]].ravel().astype(np.float64)
    away = np.linalg.norm(np.linalg.solve(axes, places.T), axis=0)
    plane = np.column_stack([np.ones(len(places)), places])
    is_white = (away > white) & (away < around)
    if is_white.sum() < len(plane.T) or not np.any(away < _BLACK):
        return start
    bright = np.maximum(plane @ np.linalg.lstsq(plane[is_white], tones[is_white], rcond=None)[0], 1.0)
    dark = float(np.median((tones / bright)[away < _BLACK]))
    if dark > _DARK:
        return start
    darkness = (1 - tones / bright) / (1 - dark)
    noise = max(np.std(darkness[is_white]), np.std(darkness[away < _BLACK]))
    minimum = float(np.clip(_NOISE * noise, *_MIN_DARKNESS))
    shares = np.clip((darkness - minimum) / (1 - 2 * minimum), 0, 1) * (away < around)
    moved = shares @ places / shares.sum()
    return start + moved if np.linalg.norm(np.linalg.solve(axes, moved)) < _MOVED else start


def center_bias(target: Circles | AsymmetricCircles, ids: NDArray[np.intp], pixels: Array) -> Array:
    """Centre of each disc's image minus the image of its centre (n, 2) [px].

    The rim of each disc is mapped by a homography of the board's plane and polynomials of what it leaves, such as of a
    lens, both fitted to all centres. By a homography alone the image is an ellipse (J. Heikkilä, PAMI 2000).
    """
    points = target.points()[ids, :2]
    H, _ = cv2.findHomography(points, pixels)
    if H is None:
        return np.zeros_like(pixels)
    low, high = points.min(axis=0), points.max(axis=0)
    degree = max((d for d in range(2, _DEGREE + 1) if _FOR_EACH * (d + 1) * (d + 2) // 2 <= len(points)), default=0)

    def basis(places: Array) -> Array:
        x, y = ((2 * places - low - high) / (high - low).max()).T
        return np.stack([x ** (of - power) * y**power for of in range(degree + 1) for power in range(of + 1)], axis=1)

    left = pixels - cv2.perspectiveTransform(points[:, None], H)[:, 0]
    coefficients = np.linalg.lstsq(basis(points), left, rcond=None)[0] if degree else np.zeros((1, 2))

    def mapped(places: Array) -> Array:
        return cv2.perspectiveTransform(places[:, None], H)[:, 0] + basis(places) @ coefficients

    angles = 2 * np.pi * np.arange(_RIM) / _RIM
    # The polygon has the area of the disc.
    radius = target.diameter / 2 * np.sqrt(2 * np.pi / (_RIM * np.sin(2 * np.pi / _RIM)))
    rim = points[:, None] + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    centers = mapped(points)
    return _centroid(mapped(rim.reshape(-1, 2)).reshape(rim.shape) - centers[:, None])


def _centroid(polygons: Array) -> Array:
    """Centres of area (n, 2) of polygons (n, m, 2)."""
    following = np.roll(polygons, -1, axis=1)
    areas = polygons[..., 0] * following[..., 1] - polygons[..., 1] * following[..., 0]
    return np.sum((polygons + following) * areas[..., None], axis=1) / (3 * areas.sum(axis=1)[:, None])
