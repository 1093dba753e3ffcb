"""How well an image shows the points of a board: what they scatter by, how sharp edges are, what is saturated."""

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from calib.board.corners.order import cells
from calib.board.corners.to_8bit import Grey, Image
from calib.board.target import AsymmetricCircles, Charuco, Circles, Target, outline

#: Deviation of a corner that fewer points than can tell it are given [px].
USUAL_SIGMA_PX = 0.15
#: No estimate from a few dozen points is better than this [px].
_LEAST_SIGMA_PX = 0.02

#: Values that an analogue-to-digital converter of 10, 12, 14 or 16 bits ends at.
_FULL_SCALES = (1023, 4095, 16383, 65535)

#: Samples of the brightness across an edge.
_SAMPLES = 33


def lattice(target: Target, ids: NDArray[np.intp], pixels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (rows, columns, 2) where they belong on the board, NaN where none was found."""
    columns, rows = target.grid
    whole = np.full((rows * columns, 2), np.nan)
    whole[ids] = pixels
    return whole.reshape(rows, columns, 2)


def spacing_px(points: NDArray[np.float64]) -> float:
    """Median distance of neighbours in the direction in which they are closer (rows, columns, 2) [px]; NaN if none."""
    steps = [np.linalg.norm(np.diff(points, axis=axis), axis=-1) for axis in (0, 1)]
    known = [float(np.median(step[~np.isnan(step)])) for step in steps if not np.isnan(step).all()]
    return min(known, default=float("nan"))


def sigma_px(target: Target, ids: NDArray[np.intp], pixels: NDArray[np.float64]) -> float:
    """Standard deviation of one coordinate of a point [px], estimated from the points themselves.

    What a homography leaves is lens distortion, which is smooth, and noise, which is not. Third differences along rows
    and columns, x₃ − 3 x₂ + 3 x₁ − x₀, cancel what is smooth and have √20 times the deviation of the noise. With fewer
    than ten of them it is `USUAL_SIGMA_PX`.
    """
    board = target.points()[ids, :2]
    H, _ = cv2.findHomography(board, pixels)
    if H is None:
        return USUAL_SIGMA_PX
    residual = lattice(target, ids, pixels - cv2.perspectiveTransform(board[:, None], H)[:, 0])
    differences = np.concatenate([np.diff(residual, n=3, axis=axis).ravel() for axis in (0, 1)])
    differences = differences[~np.isnan(differences)]
    if len(differences) < 20:
        return USUAL_SIGMA_PX
    return max(float(1.4826 * np.median(np.abs(differences)) / np.sqrt(20)), _LEAST_SIGMA_PX)


def saturated_share(target: Target, ids: NDArray[np.intp], pixels: NDArray[np.float64], image: Image) -> float:
    """Part of the board's pixels that are as bright as the sensor can tell, 0 to 1.

    That is 255 in 8 bits, and in 16 bits the largest number of 10, 12, 14 or 16 bits if it is the image's largest.
    Other types have no largest number and are never saturated.
    """
    full = full_scale(image)
    H, _ = cv2.findHomography(target.points()[ids, :2], pixels)
    if np.isnan(full) or H is None:
        return 0.0
    corners = cv2.perspectiveTransform(outline(target)[:, None, :2], H)
    inside = np.zeros(image.shape[:2], np.uint8)
    cv2.fillConvexPoly(inside, np.rint(corners).astype(np.int32), 1)
    return float(is_saturated(image)[inside > 0].mean()) if inside.any() else 0.0


def full_scale(image: Image) -> float:
    """The number at which a sensor saturates, NaN if it is not known."""
    if image.dtype == np.uint8:
        return 255.0
    largest = float(np.max(image)) if image.dtype == np.uint16 else np.nan
    return largest if largest in _FULL_SCALES else float("nan")


def is_saturated(image: Image) -> NDArray[np.bool_]:
    """Which pixels (height, width) are as bright as the sensor can tell; of colours all channels."""
    full = np.asarray(np.greater_equal(image, full_scale(image)), np.bool_)
    return np.asarray(full.all(axis=2) if full.ndim == 3 else full)


def edge_px(target: Target, points: NDArray[np.float64], levels: Grey) -> float:
    """Distance over which edges rise from 10 to 90 % [px], in the direction in which it is longer; NaN without edges.

    Brightness is read along lines across all edges of one direction and averaged. A Gaussian blur of deviation σ has
    its steepest slope, contrast / (σ √2π), at the edge, and rises from 10 to 90 % within 2.563 σ.
    """
    rises = [_rise(*_lines(target, points, axis), levels) for axis in (0, 1)]
    known = [rise for rise in rises if not np.isnan(rise)]
    return max(known, default=float("nan"))


def _rise(start: NDArray[np.float64], end: NDArray[np.float64], levels: Grey) -> float:
    """The rise of an edge that all lines from `start` to `end` (n, 2) cross half way [px]."""
    seen = ~np.isnan(start + end).any(axis=1)
    start, end = start[seen], end[seen]
    if not len(start):
        return float("nan")
    part = np.linspace(0, 1, _SAMPLES)[:, None, None]
    u, v = np.moveaxis(start + part * (end - start), -1, 0)
    profiles = map_coordinates(levels.astype(np.float32), [v, u], order=1, mode="nearest")
    profile = np.where(profiles[-1] > profiles[0], profiles, -profiles).mean(axis=1)
    contrast, slope = float(np.ptp(profile)), float(np.diff(profile).max())
    length = float(np.median(np.linalg.norm(end - start, axis=1))) / (_SAMPLES - 1)
    return 2.563 / np.sqrt(2 * np.pi) * contrast / max(slope, 1e-6) * length


def _lines(target: Target, points: NDArray[np.float64], axis: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Ends (n, 2) of lines across edges: from disc half way to the next, or from square to square across their edge.

    A ChArUco's white squares are white only near their edges, so lines end before the marker begins.
    """
    if isinstance(target, Circles | AsymmetricCircles):
        before, after = np.split(
            np.stack([points[:-1], points[1:]] if axis == 0 else [points[:, :-1], points[:, 1:]]), 2
        )
        return before.reshape(-1, 2), (0.5 * (before + after)).reshape(-1, 2)
    middle = cells(points)
    before, after = (middle[:-1], middle[1:]) if axis == 0 else (middle[:, :-1], middle[:, 1:])
    reach = (target.square - target.marker) / (2 * target.square) if isinstance(target, Charuco) else 0.8
    center, half = 0.5 * (before + after), 0.5 * reach * (after - before)
    return (center - half).reshape(-1, 2), (center + half).reshape(-1, 2)
