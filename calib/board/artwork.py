"""Printed pattern of a board: black shapes in the board's frame, for paper and for simulation."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.board.april_grid import AprilGrid, black_cells
from calib.board.target import Charuco, Chessboard, Target

#: Width of a marker's black frame, in cells.
_FRAME = 1


@dataclass(frozen=True, slots=True, eq=False)
class Artwork:
    """Black shapes on white.

    Attributes:
        rectangles: left, top, width, height (n, 4) [m].
        discs: x and y of the centre, and the radius (m, 3) [m].
    """

    rectangles: NDArray[np.float64]
    discs: NDArray[np.float64]


def artwork(target: Target) -> Artwork:
    """Shapes of a board in its own frame, with the first corner, or the centre of the first disc, at (0, 0)."""
    if isinstance(target, Chessboard):
        return Artwork(_squares(target.columns + 1, target.rows + 1, target.square, odd=0), np.zeros((0, 3)))
    if isinstance(target, Charuco):
        squares = _squares(target.columns, target.rows, target.square, odd=int(not target.is_first_black))
        return Artwork(np.concatenate([squares, _markers(target)]), np.zeros((0, 3)))
    if isinstance(target, AprilGrid):
        return Artwork(target.black_rectangles(), np.zeros((0, 3)))
    centers = target.points()[:, :2]
    radius = np.full((len(centers), 1), target.diameter / 2)
    return Artwork(np.zeros((0, 4)), np.concatenate([centers, radius], axis=1))


def _squares(columns: int, rows: int, square: float, odd: int) -> NDArray[np.float64]:
    """Left, top, width, height of the squares whose column and row sum is even (odd = 0) or odd (odd = 1)."""
    row, column = np.indices((rows, columns))
    chosen = (row + column) % 2 == odd
    edge = np.full(np.count_nonzero(chosen), square)
    return np.stack([(column[chosen] - 1) * square, (row[chosen] - 1) * square, edge, edge], axis=1)


def _markers(target: Charuco) -> NDArray[np.float64]:
    """Black parts of all markers."""
    dictionary = target.markers()
    cells = dictionary.markerSize + 2 * _FRAME
    cell = target.marker / cells
    white = _squares(target.columns, target.rows, target.square, odd=int(target.is_first_black))
    found = []
    for number, (left, top, edge, _) in zip(target.ids().tolist(), white, strict=True):
        image, inset = cv2.aruco.generateImageMarker(dictionary, number, cells), (edge - target.marker) / 2
        found += black_cells(image, left + inset, top + inset, cell)
    return np.array(found)


def rasterize(target: Target, density: float, samples: int = 4) -> tuple[NDArray[np.float32], tuple[float, float]]:
    """Image of the print, 0 (black) to 1 (white), with a white border as wide as its margin.

    Args:
        target: the board.
        density: pixels per metre.
        samples: supersampling per pixel and axis.

    Returns:
        The image (rows, columns), and the position of its first pixel's centre in the board's frame, (x, y) [m].
    """
    shapes, points = artwork(target), target.points()[:, :2]
    rim = 2 * target.margin
    left, top = points.min(axis=0) - rim
    width, height = np.ptp(points, axis=0) + 2 * rim
    fine = samples * density
    size = samples * round(height * density), samples * round(width * density)
    x = left + (np.arange(size[1]) + 0.5) / fine
    y = top + (np.arange(size[0]) + 0.5) / fine
    white = np.ones(size, np.float32)
    for rectangle in shapes.rectangles:
        columns = np.searchsorted(x, (rectangle[0], rectangle[0] + rectangle[2]))
        rows = np.searchsorted(y, (rectangle[1], rectangle[1] + rectangle[3]))
        white[slice(*rows), slice(*columns)] = 0
    for center_x, center_y, radius in shapes.discs:
        columns = slice(*np.searchsorted(x, (center_x - radius, center_x + radius)))
        rows = slice(*np.searchsorted(y, (center_y - radius, center_y + radius)))
        inside = (x[None, columns] - center_x) ** 2 + (y[rows, None] - center_y) ** 2 <= radius**2
        white[rows, columns][inside] = 0
    mean = white.reshape(size[0] // samples, samples, size[1] // samples, samples).mean(axis=(1, 3))
    return mean, (left + 0.5 / density, top + 0.5 / density)
