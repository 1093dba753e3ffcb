"""Raw detection of board points by OpenCV, without checks and ordering."""

from collections.abc import Callable, Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.board.april_grid import AprilGrid
from calib.board.corners.april_tags import find_april_grid
from calib.board.corners.markers import find_charuco
from calib.board.corners.order import brightness, cells
from calib.board.corners.to_8bit import Grey, local_contrast, scaled, unscaled
from calib.board.target import AsymmetricCircles, Charuco, Chessboard, Circles, Target

Found = tuple[NDArray[np.intp], NDArray[np.float64]]

#: Images above this size are searched at an integer fraction of their size [px]; corners are refined later.
_MAX_SIDE = 2000
#: The same of the first searches for a chessboard, which take long in large images with clutter or noise and no board.
_MAX_SIDE_AT_FIRST = 1000
#: Images below this size are enlarged if nothing is found, because squares and discs need about ten pixels [px].
_MIN_SIDE, _MIN_SIDE_OF_DISCS = 400, 1000

#: Largest number of blobs per disc; the grid search takes minutes above it.
_MAX_BLOBS = 3

#: A board goes on beyond the border if its last point is nearer to it than this many distances between points.
_CUT = 1.1

#: Contrast between the squares of a row, relative to that of the others, below which they are a frame and no squares.
_FRAME = 0.3

#: A chessboard, for what depends on the kind of board alone.
_ANY = Chessboard(4, 3, 0.01)

#: Minimum number of points in a view.
MIN_POINTS = 6

_NOTHING: Found = (np.zeros(0, np.intp), np.zeros((0, 2)))


def find(target: Target, levels: Grey) -> Found:
    """Indices (n,) and pixels (n, 2) of the detected points, in OpenCV's order.

    All boards but ChArUco and AprilGrid are detected completely or not at all; then n is 0. Hidden corners of a
    chessboard or a ChArUco may be where they are expected.
    """
    best = _NOTHING
    for image, scale, search in _attempts(target, levels):
        ids, pixels = search(target, scaled(image, scale))
        if len(ids) > len(best[0]):
            best = ids, unscaled(pixels, scale)
        if len(best[0]) >= MIN_POINTS:
            break
    return best


def _attempts(target: Target, levels: Grey) -> Iterator[tuple[Grey, float, Callable[..., Found]]]:
    """Images to search, with their scales and searches; in most images a board is found by the first of them."""
    for enhanced in (np.asarray, local_contrast):  # the second one only if it is needed
        image = enhanced(levels)
        for scale in _scales(target, levels):
            yield image, scale, _find
    if isinstance(target, Chessboard):
        is_small = max(levels.shape) <= _MAX_SIDE_AT_FIRST
        yield (levels, 2, _by_sectors) if is_small else (levels, _reduction(levels, _MAX_SIDE), _find)


def _scales(target: Target, levels: Grey) -> Iterator[float]:
    size = max(levels.shape)
    maximum = _MAX_SIDE_AT_FIRST if isinstance(target, Chessboard) else _MAX_SIDE
    if size > maximum and not isinstance(target, Charuco | AprilGrid):
        yield _reduction(levels, maximum)
        return
    yield 1
    if isinstance(target, Charuco):
        return  # is enlarged as its squares need it
    if size < (_MIN_SIDE_OF_DISCS if isinstance(target, Circles | AsymmetricCircles) else _MIN_SIDE):
        yield 2
        yield 4


def _reduction(levels: Grey, maximum: int) -> float:
    """Integer fraction that makes an image at most this large [px]."""
    return 1 / int(np.ceil(max(levels.shape) / maximum))


def _find(target: Target, levels: Grey) -> Found:
    match target:
        case Chessboard():
            return _find_chessboard(target, levels)
        case Charuco():
            return find_charuco(target, levels)
        case AprilGrid():
            return find_april_grid(target, levels)
        case Circles():
            found, corners = _find_circles(target, levels, cv2.CALIB_CB_SYMMETRIC_GRID)
        case AsymmetricCircles():
            found, corners = _find_circles(target, levels, cv2.CALIB_CB_ASYMMETRIC_GRID)
    return _complete(corners) if found else _NOTHING


def _complete(corners: NDArray[np.integer | np.floating]) -> Found:
    return np.arange(len(corners)), corners.reshape(-1, 2).astype(np.float64)


def _find_chessboard(target: Chessboard, levels: Grey) -> Found:
    """Corners by the sector-based search or else, as that one misses boards bent by a fisheye, by linking dark squares.

    The first bears blur and noise better. `CALIB_CB_FAST_CHECK` misses a board now and then, which the image with local
    contrast shows; without it, images with clutter and no board take much longer.
    """
    ids, pixels = _by_sectors(target, levels)
    if len(ids):
        return ids, pixels
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
    found, linked = cv2.findChessboardCorners(levels, target.grid, flags=flags)
    corners = np.asarray(linked, np.float64) if found else np.zeros((0, 2))
    is_board = found and _alternates(corners.reshape(target.grid[1], target.grid[0], 2), levels)
    return _complete(corners) if is_board else _NOTHING


def _by_sectors(target: Chessboard, levels: Grey) -> Found:
    """Corners by sectors; `CALIB_CB_ACCURACY`, which takes four times as long, gives only small images better ones."""
    accuracy = cv2.CALIB_CB_ACCURACY if max(levels.shape) < _MIN_SIDE else 0
    found, corners = cv2.findChessboardCornersSB(levels, target.grid, flags=cv2.CALIB_CB_NORMALIZE_IMAGE | accuracy)
    return _complete(corners) if found else _NOTHING


def _alternates(lattice: NDArray[np.float64], levels: Grey) -> bool:
    """True if of any two neighbouring cells between the corners one is dark and one bright, as on a chessboard."""
    squares = brightness(cells(lattice), levels)
    signs = 1 - 2.0 * (np.indices(squares.shape).sum(axis=0) % 2)
    steps = [signs[1:] * np.diff(squares, axis=0), signs[:, 1:] * np.diff(squares, axis=1)]
    rises = np.concatenate([step.ravel() for step in steps])
    return bool((rises > 0).all() or (rises < 0).all())


def chessboard_size(levels: Grey) -> tuple[int, int]:
    """Numbers of inner corners of the chessboard in an image, the larger first; (0, 0) if there is none.

    Some images show only a part of their board to this search. In others it takes the ends of the outermost squares for
    corners, where a dark frame follows; beyond corners there are squares.
    """
    levels = scaled(levels, next(_scales(_ANY, levels)))
    corners = _part_of_chessboard(levels)
    if not corners.size:
        return 0, 0
    rim = ((1, 1), (1, 1), (0, 0))
    beyond = 0.5 * (np.pad(corners, rim, "reflect", reflect_type="odd") + np.pad(corners, rim, "edge"))  # half squares
    found = brightness(cells(beyond), levels)
    sizes = []
    for squares in (found, found.T):
        contrasts = np.median(np.abs(np.diff(squares, axis=1)), axis=1)
        ends = contrasts[[0, -1]] < _FRAME * np.median(contrasts[1:-1])
        sizes.append(len(squares) - 1 - int(ends.sum()))
    # 3 × 3 corners are the least that is searched for, and are found by chance, as among the squares of markers.
    return (max(sizes), min(sizes)) if min(sizes) > 2 and max(sizes) > 3 else (0, 0)


def _part_of_chessboard(levels: Grey) -> NDArray[np.float64]:
    """Corners (n, m, 2) of a chessboard of any size, or of a part of it; (0, 0, 2) without one."""
    flags = cv2.CALIB_CB_LARGER | cv2.CALIB_CB_NORMALIZE_IMAGE
    found, corners, meta = cv2.findChessboardCornersSBWithMeta(levels, (3, 3), flags)
    return np.asarray(corners, np.float64).reshape(*meta.shape, 2) if found else np.zeros((0, 0, 2))


def is_cut_off(target: Target, levels: Grey) -> bool:
    """True if an image without a detection shows part of a board that continues beyond the border."""
    levels = scaled(levels, next(_scales(target, levels)))
    match target:
        case Chessboard():
            corners = _part_of_chessboard(levels)
            columns, rows = corners.shape[:2]
            if not corners.size or max(columns, rows) > max(target.grid) or min(columns, rows) > min(target.grid):
                return False  # of another board there is nothing to say
            part = corners.reshape(-1, 2)
        case Charuco() | AprilGrid():
            return False
        case _:
            blobs = _disc_detector(target, levels).detect(levels)
            part = np.array([blob.pt for blob in blobs]).reshape(-1, 2)
    if not 9 <= len(part) <= _MAX_BLOBS * len(target.points()):
        return False
    between = np.linalg.norm(part[:, None] - part[None], axis=-1)
    between[np.diag_indices(len(part))] = np.inf
    closest = between.min(axis=1)
    regular = closest.std() < 0.3 * np.median(closest)  # rejects clutter that resembles discs
    to_end = np.minimum(part, np.array(levels.shape[::-1]) - 1 - part).min(axis=1)
    return bool(regular and (to_end < _CUT * closest).any())


def count_of_discs(target: Circles | AsymmetricCircles, levels: Grey) -> int:
    """Number of blobs in an image that may be discs of a board."""
    levels = scaled(levels, next(_scales(target, levels)))
    return len(_disc_detector(target, levels).detect(levels))


def _find_circles(target: Circles | AsymmetricCircles, levels: Grey, kind: int) -> tuple[bool, NDArray[np.floating]]:
    nothing = False, np.zeros((0, 2))
    discs = target.columns * target.rows
    detector = _disc_detector(target, levels)
    if not discs <= len(detector.detect(levels)) <= _MAX_BLOBS * discs:
        return nothing
    for how in (kind, kind | cv2.CALIB_CB_CLUSTERING):
        found, centers = cv2.findCirclesGrid(levels, target.grid, flags=how, blobDetector=detector)
        if found:
            return True, np.asarray(centers, np.float64)
    return nothing


def _disc_detector(target: Circles | AsymmetricCircles, levels: Grey) -> cv2.SimpleBlobDetector:
    parameters = cv2.SimpleBlobDetector.Params()
    # The defaults limit blobs to 5000 pixels and use threshold steps so large that centres jump.
    parameters.minArea = 12
    parameters.maxArea = max(levels.size / (target.columns * target.rows), parameters.minArea)
    parameters.minDistBetweenBlobs = 4
    parameters.thresholdStep = 5
    return cv2.SimpleBlobDetector.create(parameters)
