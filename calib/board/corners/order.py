"""Assignment of detected points to board points, for boards with rotational symmetry."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from calib.board.april_grid import AprilGrid
from calib.board.corners.to_8bit import Grey
from calib.board.target import AsymmetricCircles, Charuco, Chessboard, Circles, Target

Lattice = NDArray[np.float64]


def canonical_order(target: Target, pixels: NDArray[np.float64], levels: Grey) -> NDArray[np.float64]:
    """All points (n, 2) of a board in the order of `target.points()`, from OpenCV's order.

    x × y points into the image as on the board. Remaining rotations are resolved by the colours of the squares, or else
    by the direction of x, which points to the right.
    """
    if isinstance(target, Charuco | AprilGrid):
        return pixels
    lattice = pixels.reshape(target.grid[1], target.grid[0], 2)
    match target:
        case AsymmetricCircles():
            # The pattern is invariant to a reversal of its rows, but not of its columns.
            return (lattice if is_right_handed(lattice) else lattice[::-1]).reshape(-1, 2)
        case Circles():
            ways = _ways(lattice)
        case Chessboard():
            ways = [way for way in _ways(lattice) if _first_is_black(way, levels)] or _ways(lattice)
    return max(ways, key=_rightwards).reshape(-1, 2)


def is_right_handed(lattice: Lattice) -> bool:
    """True if points (rows, columns, 2) have the orientation of a board seen from its printed side."""
    along, down = lattice[0, -1] - lattice[0, 0], lattice[-1, 0] - lattice[0, 0]
    return bool(along[0] * down[1] - along[1] * down[0] > 0)


def cells(lattice: Lattice) -> Lattice:
    """Centres (rows - 1, columns - 1, 2) of the cells between four corners each."""
    return 0.25 * (lattice[1:, 1:] + lattice[:-1, 1:] + lattice[1:, :-1] + lattice[:-1, :-1])


def brightness(places: Lattice, levels: Grey) -> NDArray[np.floating]:
    """Brightness (rows, columns) at places (rows, columns, 2) [px] of an image."""
    u, v = np.moveaxis(places, -1, 0)
    return map_coordinates(levels.astype(np.float32), [v, u], order=1, mode="nearest")


def _ways(lattice: Lattice) -> list[Lattice]:
    """Possible orders of the points, all right-handed."""
    seen = lattice if is_right_handed(lattice) else lattice[:, ::-1]
    square = seen.shape[0] == seen.shape[1]
    return [np.rot90(seen, quarter) for quarter in (range(4) if square else (0, 2))]


def _first_is_black(lattice: Lattice, levels: Grey) -> bool:
    """True if the square after the first corner is black, like the one in the board's corner."""
    squares = brightness(cells(lattice), levels)
    black = np.indices(squares.shape).sum(axis=0) % 2 == 0
    return bool(squares[black].mean() < squares[~black].mean())


def _rightwards(lattice: Lattice) -> float:
    """Cosine of the angle between the image's rows and the board's."""
    along = lattice[:, -1].mean(axis=0) - lattice[:, 0].mean(axis=0)
    return float(along[0] / np.linalg.norm(along))
