"""Quality of a detection: corner noise, sharpness of edges, saturation."""

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, map_coordinates

from calib.board.april_grid import BITS, BORDER, AprilGrid
from calib.board.corners.order import cells
from calib.board.corners.to_8bit import Grey, Image
from calib.board.target import AsymmetricCircles, Charuco, Circles, Target, outline

#: Deviation of a corner if too few points allow an estimate [px].
DEFAULT_SIGMA_PX = 0.15
#: Lower bound of the estimate [px].
_MIN_SIGMA_PX = 0.02

#: Full scales of analogue-to-digital converters with 10, 12, 14 and 16 bits.
_FULL_SCALES = (1023, 4095, 16383, 65535)

#: Number of brightness samples across an edge, and deviation of the smoothing along them [samples].
_SAMPLES, _SMOOTHED = 33, 2.0


def lattice(target: Target, ids: NDArray[np.intp], pixels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points as a grid (rows, columns, 2), NaN where not detected."""
    columns, rows = target.grid
    whole = np.full((rows * columns, 2), np.nan)
    whole[ids] = pixels
    return whole.reshape(rows, columns, 2)


def spacing_px(points: NDArray[np.float64]) -> float:
    """Median distance of neighbours (rows, columns, 2) along the axis with the smaller one [px]; NaN without any."""
    steps = [np.linalg.norm(np.diff(points, axis=axis), axis=-1) for axis in (0, 1)]
    known = [float(np.median(step[~np.isnan(step)])) for step in steps if not np.isnan(step).all()]
    return min(known, default=float("nan"))


def sigma_px(target: Target, ids: NDArray[np.intp], pixels: NDArray[np.float64]) -> float:
    """Standard deviation of one coordinate of a point [px], estimated from the points themselves.

    Residuals from a homography consist of smooth lens distortion and noise. Third differences along rows and columns,
    x₃ − 3 x₂ + 3 x₁ − x₀, cancel smooth terms and have √20 times the deviation of the noise. With fewer than ten of
    them the result is `DEFAULT_SIGMA_PX`.
    """
    board = target.points()[ids, :2]
    H, _ = cv2.findHomography(board, pixels)
    if H is None:
        return DEFAULT_SIGMA_PX
    residual = lattice(target, ids, pixels - cv2.perspectiveTransform(board[:, None], H)[:, 0])
    differences = np.concatenate([np.diff(residual, n=3, axis=axis).ravel() for axis in (0, 1)])
    differences = differences[~np.isnan(differences)]
    if len(differences) < 20:
        return DEFAULT_SIGMA_PX
    return max(float(1.4826 * np.median(np.abs(differences)) / np.sqrt(20)), _MIN_SIGMA_PX)


def saturated_fraction(target: Target, ids: NDArray[np.intp], pixels: NDArray[np.float64], image: Image) -> float:
    """Fraction of the board's pixels at full scale, 0 to 1.

    Full scale is 255 in 8 bits; in 16 bits it is that of 10, 12, 14 or 16 bits if the image's maximum equals it. Other
    types have no full scale and are never saturated.
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
    """Value at which a sensor saturates, NaN if unknown."""
    if image.dtype == np.uint8:
        return 255.0
    largest = float(np.max(image)) if image.dtype == np.uint16 else np.nan
    return largest if largest in _FULL_SCALES else float("nan")


def is_saturated(image: Image) -> NDArray[np.bool_]:
    """Mask (height, width) of pixels at full scale; for colours, in all channels."""
    full = np.asarray(np.greater_equal(image, full_scale(image)), np.bool_)
    return np.asarray(full.all(axis=2) if full.ndim == 3 else full)


def edges_px(target: Target, points: NDArray[np.float64], levels: Grey) -> tuple[float, float]:
    """Widths of edges from 10 to 90 % [px], along the axis with the wider ones and along the other; NaN without edges.

    Brightness is sampled along a line across each edge; the width of a direction is the median over its edges. Profiles
    are not averaged: distortion and tilt move edges off the middle of their lines, so the mean edge would be wide.
    """
    widths = [_widths(*_lines(target, points, axis), levels) for axis in (0, 1)]
    known = [float(np.median(width)) for width in widths if len(width)]
    return max(known, default=float("nan")), min(known, default=float("nan"))


def _widths(start: NDArray[np.float64], end: NDArray[np.float64], levels: Grey) -> NDArray[np.float64]:
    """Edge widths [px] along lines `start` to `end` (n, 2) that cross one edge each; fewer than n if some are NaN.

    A Gaussian blur of deviation σ has its steepest slope, contrast / (σ √2π), at the edge, and rises from 10 to 90 %
    within 2.563 σ. Noise makes slopes steeper, so profiles are smoothed first, and that blur is subtracted.
    """
    seen = ~np.isnan(start + end).any(axis=1)
    start, end = start[seen], end[seen]
    part = np.linspace(0, 1, _SAMPLES)[:, None, None]
    u, v = np.moveaxis(start + part * (end - start), -1, 0)
    profiles = map_coordinates(levels.astype(np.float32), [v, u], order=1, mode="nearest")
    smooth = gaussian_filter1d(profiles, _SMOOTHED, axis=0, mode="nearest")
    contrast, slope = np.ptp(smooth, axis=0), np.abs(np.diff(smooth, axis=0)).max(axis=0)
    blur = contrast / (np.sqrt(2 * np.pi) * np.maximum(slope, 1e-6))
    step = np.linalg.norm(end - start, axis=1) / (_SAMPLES - 1)
    return 2.563 * step * np.sqrt(np.maximum(blur**2 - _SMOOTHED**2, 0))


def _lines(target: Target, points: NDArray[np.float64], axis: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Ends (n, 2) of lines across edges: from a disc half way to the next, or between the centres of adjacent squares.

    A ChArUco's white squares are white only near their edges, so lines end before the marker begins.
    """
    if isinstance(target, Circles | AsymmetricCircles):
        before, after = np.split(
            np.stack([points[:-1], points[1:]] if axis == 0 else [points[:, :-1], points[:, 1:]]), 2
        )
        return before.reshape(-1, 2), (0.5 * (before + after)).reshape(-1, 2)
    if isinstance(target, AprilGrid):
        return _tag_edges(target, points, axis)
    middle = cells(points)
    before, after = (middle[:-1], middle[1:]) if axis == 0 else (middle[:, :-1], middle[:, 1:])
    reach = (target.square - target.marker) / (2 * target.square) if isinstance(target, Charuco) else 0.8
    center, half = 0.5 * (before + after), 0.5 * reach * (after - before)
    return (center - half).reshape(-1, 2), (center + half).reshape(-1, 2)


def _tag_edges(
    target: AprilGrid, points: NDArray[np.float64], axis: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lines across the edges of tags, within their black frames and the white between them."""
    lattice = points if axis == 1 else points.transpose(1, 0, 2)
    before, after = (0.5 * (lattice[::2, side::2] + lattice[1::2, side::2]) for side in (0, 1))
    share = 0.9 * min(BORDER / (BITS + 2 * BORDER), target.gap / target.tag)
    reach = share * (after - before)
    lines = np.concatenate([(before - reach, before + reach), (after - reach, after + reach)], axis=1)
    return lines[0].reshape(-1, 2), lines[1].reshape(-1, 2)
