"""Points that are not where their neighbours say: a search guessed them, or something that covers a part moved them."""

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.board.target import Target

#: Points of a line that are compared; a cubic through three of them and any smooth distortion predict the fourth.
_COMPARED = 4
#: How much longer they may be than on the whole board, as others between are missing.
_REACH = 2.0

#: A point is misplaced if what its neighbours say is off by more than this many deviations, …
_DEVIATIONS = 6.0
#: … which are at least this [px], by this part of the distance of neighbours, as no lens is a cubic, and by this [px].
_SIGMA_PX, _SMOOTH, _HARMLESS_PX = 0.03, 0.015, 0.5

#: Median length of a vector of two coordinates with unit deviation, and lengths that are the same [m].
_MEDIAN, _SAME = 1.18, 1e-6

Array = NDArray[np.float64]


def is_in_place(target: Target, ids: NDArray[np.intp], pixels: Array, spacing: float) -> NDArray[np.bool_]:
    """True for points whose pixels (n, 2) agree with those beside them in rows and columns.

    What a homography leaves is smooth: the lens, and a sheet that is slightly bent. Its divided differences of third
    order are noise. The point whose displacement explains most of them is left out, until none explains much, and with
    it those that nothing but such points spoke for. Others with fewer than three near them in a line are not judged.

    Args:
        target: the board.
        ids: indices into its points (n,).
        pixels: their images.
        spacing: distance of neighbours [px].
    """
    is_good, points = np.ones(len(ids), np.bool_), target.points()[:, :2]
    H, _ = cv2.findHomography(points[ids], pixels)
    if H is None:
        return is_good
    flat = pixels - cv2.perspectiveTransform(points[ids][:, None], H)[:, 0]  # rougher than the pixels by some fisheyes
    length = max((_span(points[line]) for axis in (0, 1) for line in _lines(points, axis)), default=1.0)
    differences = _differences(points[ids], is_good, length)
    is_judged = differences.any(axis=0)
    while len(differences):
        found = min((differences @ each for each in (flat, pixels)), key=_sigma)
        known = np.sqrt(np.maximum(np.sum(differences**2, axis=0), 1e-6))
        pulls = np.linalg.norm(differences.T @ found, axis=1) / known
        pulls[pulls < _HARMLESS_PX * known] = 0
        worst = np.argmax(pulls)
        if pulls[worst] < max(_DEVIATIONS * _sigma(found), _SMOOTH * spacing):
            break
        is_good[worst] = False
        differences = _differences(points[ids], is_good, length)
    return is_good & (differences.any(axis=0) | ~is_judged)


def _sigma(differences: Array) -> float:
    """Robust deviation of one coordinate of differences (m, 2) [px]."""
    return max(float(np.median(np.linalg.norm(differences, axis=1))) / _MEDIAN, _SIGMA_PX)


def _differences(points: Array, is_good: NDArray[np.bool_], length: float) -> Array:
    """Divided differences of third order of the good ones of points (n, 2), with unit deviation (m, n).

    Where they are further apart than `length` they count for less: what is no cubic grows with its third power.
    """
    indices = np.flatnonzero(is_good)
    members = np.concatenate([_lines(points[indices], axis) for axis in (0, 1)])
    spans = np.array([_span(points[indices[line]]) for line in members])
    members, spans = indices[members[spans < _REACH * length]], spans[spans < _REACH * length]
    places = np.linalg.norm(points[members] - points[members[:, :1]], axis=2) / spans[:, None]
    weights = 1 / (places[:, :, None] - places[:, None] + np.eye(_COMPARED)).prod(axis=2)
    weights *= (np.minimum(length / spans, 1) ** 3 / np.linalg.norm(weights, axis=1))[:, None]
    found = np.zeros((len(members), len(points)))
    np.put_along_axis(found, members, weights, axis=1)
    return found


def _lines(points: Array, axis: int) -> NDArray[np.intp]:
    """Indices of points (n, 2) that follow each other along an axis, as many as are compared (m, `_COMPARED`)."""
    beside = np.rint(points[:, 1 - axis] / _SAME)
    order = np.lexsort((points[:, axis], beside))
    if len(order) < _COMPARED:
        return np.zeros((0, _COMPARED), np.intp)
    windows = np.lib.stride_tricks.sliding_window_view(order, _COMPARED)
    return windows[beside[windows[:, 0]] == beside[windows[:, -1]]]


def _span(line: Array) -> float:
    """Length of a line of points (n, 2)."""
    return float(np.linalg.norm(line[-1] - line[0]))
