"""Grids of discs that are not as described: other numbers, another kind, or white discs."""

import cv2
import numpy as np

from calib.board.corners.search import count_of_discs, find
from calib.board.corners.to_8bit import Grey
from calib.board.target import AsymmetricCircles, Circles
from calib.board.target_checks import TargetError

#: Largest distance of discs from where a plane grid has them, relative to their spacing. OpenCV finds discs in rows
#: that are shifted as a regular grid, too, off by half of it.
_OFF = 0.1


def other_discs(target: Circles | AsymmetricCircles, levels: Grey) -> str:
    """Clause on what an image shows in place of a grid of discs; "" if that is not clear."""
    if len(find(target, 255 - levels)[0]):
        return "shows white discs on black instead of black ones on white"
    count = count_of_discs(target, levels)
    for columns in range(count // 3, 2, -1):
        if count % columns:
            continue
        for kind, words in ((Circles, "a grid"), (AsymmetricCircles, "an asymmetric grid")):
            try:
                other = kind(columns, count // columns, target.spacing, target.diameter)
            except TargetError:
                continue
            if other != target and _fits(other, levels):
                return f"shows {words} of {columns} × {count // columns} discs"
    return ""


def _fits(target: Circles | AsymmetricCircles, levels: Grey) -> bool:
    ids, pixels = find(target, levels)
    if not len(ids):
        return False
    places = target.points()[ids, :2] / target.spacing
    H, _ = cv2.findHomography(pixels, places)
    if H is None:
        return False
    off = np.linalg.norm(cv2.perspectiveTransform(pixels[:, None], H)[:, 0] - places, axis=1)
    return bool(off.max() < _OFF)
