"""Grids of discs that are not as described: other numbers, another kind, or white discs."""

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.board.corners.errors import OtherBoardError
from calib.board.corners.order import brightness
from calib.board.corners.search import count_of_discs, find
from calib.board.corners.to_8bit import Grey
from calib.board.target import AsymmetricCircles, Circles
from calib.board.target_checks import TargetError

#: Largest distance of discs from where a plane grid has them, relative to their spacing. OpenCV finds discs in rows
#: that are shifted as a regular grid, too, off by half of it.
_OFF = 0.1

#: Share of the places beyond the outermost row at which there have to be discs, to make a row of them, and their least
#: number in the image.
_ROW, _MIN_DISCS = 0.9, 3


def require_end(points: NDArray[np.float64], levels: Grey) -> None:
    """Rejects discs (rows, columns, 2) that are a part of a larger grid: of that, each image may show another part.

    Raises:
        OtherBoardError: one more row or column follows.
    """
    between, discs = (brightness(places, levels) for places in (_between(points), points))
    middle = (np.median(between) + np.median(discs)) / 2
    for lattice, words in ((points, "rows"), (points.transpose(1, 0, 2), "columns")):
        for side in (lattice, lattice[::-1]):
            beyond = (side[0] + side[1] - side[2])[None]  # in a grid with shifted rows as well
            dark, bright = brightness(beyond, levels) < middle, brightness(_between(beyond), levels) > middle
            inside = np.all((beyond >= 0) & (beyond <= np.array(levels.shape[::-1]) - 1), axis=-1)
            if inside.sum() >= _MIN_DISCS and dark[inside].mean() >= _ROW and bright[inside[:, 1:]].mean() >= _ROW:
                rows, columns = points.shape[:2]
                raise OtherBoardError(
                    f"the grid of discs has more {words} than the {columns} × {rows} of the description, so that other "
                    "discs may be taken in each image: count them, and correct the description"
                )


def _between(lattice: NDArray[np.float64]) -> NDArray[np.float64]:
    """Middles between neighbours along the rows (rows, columns - 1, 2)."""
    return (lattice[:, 1:] + lattice[:, :-1]) / 2


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
