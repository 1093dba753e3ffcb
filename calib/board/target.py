"""Kinds of boards, in the frame of `calib.board.views`: origin in the first corner, x along the first row."""

from dataclasses import dataclass
from typing import Literal, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.board.april_grid import AprilGrid
from calib.board.target_checks import TargetError, check_counts, check_extent, check_length

Points = NDArray[np.float64]

Dictionary = Literal[
    "4x4_50", "4x4_100", "4x4_250", "4x4_1000", "5x5_50", "5x5_100", "5x5_250", "5x5_1000", "6x6_50", "6x6_100",
    "6x6_250", "6x6_1000", "7x7_50", "7x7_100", "7x7_250", "7x7_1000", "original",
    "apriltag_16h5", "apriltag_25h9", "apriltag_36h10", "apriltag_36h11", "mip_36h12",
]  # fmt: skip

#: OpenCV's marker dictionaries, in the order of its enumeration.
DICTIONARIES: tuple[Dictionary, ...] = get_args(Dictionary)


@dataclass(frozen=True)
class Chessboard:
    """Black and white squares, black in the upper left corner; its corners are where four squares meet.

    With `columns + rows` odd the orientation is unique. Otherwise the board is symmetric under rotation by 180°, and
    corners are numbered so that x points to the right in the image; see `calib.solve.start.symmetric_boards`.

    Attributes:
        columns, rows: inner corners along x and y: one less than squares.
        square: edge length of a square [m].
    """

    columns: int
    rows: int
    square: float

    def __post_init__(self) -> None:
        check_counts(self.columns, self.rows, 3)
        check_length("square", self.square)
        check_extent("square", self.square, max(self.grid))

    @property
    def grid(self) -> tuple[int, int]:
        """Columns and rows of points."""
        return self.columns, self.rows

    @property
    def margin(self) -> float:
        """Extent of the print beyond the outer points [m]."""
        return self.square

    def points(self) -> Points:
        """Corners row by row (n, 3) [m]."""
        return _lattice(self.columns, self.rows, self.square)


@dataclass(frozen=True)
class Charuco:
    """Chessboard with an ArUco marker in every white square; may be partly visible.

    Its orientation is always unique, and it is the only board that reveals a mirrored image. Markers are numbered by
    rows.

    Attributes:
        columns, rows: squares along x and y; there is one corner less each way.
        square, marker: edge lengths of a square and of a marker [m].
        dictionary: OpenCV's marker dictionary.
        legacy: as OpenCV printed it before 4.6: with an even number of rows, the upper left square is white.
        first_id: number of the first marker, as of one of several boards.
    """

    columns: int
    rows: int
    square: float
    marker: float
    dictionary: Dictionary = "5x5_250"
    legacy: bool = False
    first_id: int = 0

    def __post_init__(self) -> None:
        check_counts(self.columns, self.rows, 3)
        check_length("square", self.square)
        check_length("marker", self.marker)
        check_extent("square", self.square, max(self.columns, self.rows))
        if self.marker >= self.square:
            raise TargetError(f"marker: {self.marker:g} m must be less than the square of {self.square:g} m around it")
        if self.dictionary not in DICTIONARIES:
            raise TargetError(f"dictionary: {self.dictionary!r} is none of {', '.join(DICTIONARIES)}")
        markers, needed = len(self.markers().bytesList), self.columns * self.rows // 2
        if needed > markers:
            raise TargetError(f"dictionary: {self.dictionary} has {markers} markers, this board needs {needed}")
        if not 0 <= self.first_id <= markers - needed:
            raise TargetError(
                f"first_id: {self.first_id} must be from 0 to {markers - needed}, as {self.dictionary} has {markers} "
                f"markers and this board needs {needed}"
            )

    @property
    def grid(self) -> tuple[int, int]:
        """Columns and rows of points."""
        return self.columns - 1, self.rows - 1

    @property
    def margin(self) -> float:
        """Extent of the print beyond the outer points [m]."""
        return self.square

    @property
    def is_first_black(self) -> bool:
        """True if the upper left square is black and without a marker."""
        return not (self.legacy and self.rows % 2 == 0)

    def points(self) -> Points:
        """Corners row by row (n, 3) [m]; the row index is OpenCV's corner id."""
        return _lattice(*self.grid, self.square)

    def ids(self) -> NDArray[np.int32]:
        """Numbers of the markers, by rows (n,)."""
        return np.arange(self.first_id, self.first_id + self.columns * self.rows // 2, dtype=np.int32)

    def markers(self) -> cv2.aruco.Dictionary:
        """OpenCV's dictionary."""
        return cv2.aruco.getPredefinedDictionary(DICTIONARIES.index(self.dictionary))


@dataclass(frozen=True)
class Circles:
    """Black discs on a regular grid.

    Symmetric under rotation by 180°; discs are numbered so that x points to the right in the image; see
    `calib.solve.start.symmetric_boards`.

    Attributes:
        columns, rows: discs along x and y.
        spacing: distance of the centres of neighbours [m].
        diameter: of a disc [m].
    """

    columns: int
    rows: int
    spacing: float
    diameter: float

    def __post_init__(self) -> None:
        _check_discs(self.columns, self.rows, self.spacing, self.diameter)
        check_extent("spacing", self.spacing, max(self.grid))

    @property
    def grid(self) -> tuple[int, int]:
        """Columns and rows of points."""
        return self.columns, self.rows

    @property
    def margin(self) -> float:
        """Extent of the print beyond the outer points [m]."""
        return self.diameter / 2

    def points(self) -> Points:
        """Centres row by row (n, 3) [m]."""
        return _lattice(self.columns, self.rows, self.spacing)


@dataclass(frozen=True)
class AsymmetricCircles:
    """Black discs in rows that are shifted against each other, every second row by `spacing`; unique orientation.

    Attributes:
        columns: discs in a row.
        rows: an odd number.
        spacing: distance of the rows, and half that of the discs in a row [m].
        diameter: of a disc [m].
    """

    columns: int
    rows: int
    spacing: float
    diameter: float

    def __post_init__(self) -> None:
        _check_discs(self.columns, self.rows, self.spacing, self.diameter)
        check_extent("spacing", self.spacing, max(2 * self.columns, self.rows))
        if self.rows % 2 == 0:
            raise TargetError(f"rows: {self.rows} must be odd; with an even number the board has two ways up")

    @property
    def grid(self) -> tuple[int, int]:
        """Columns and rows of points."""
        return self.columns, self.rows

    @property
    def margin(self) -> float:
        """Extent of the print beyond the outer points [m]."""
        return self.diameter / 2

    def points(self) -> Points:
        """Centres row by row (n, 3) [m]."""
        row, column = np.divmod(np.arange(self.columns * self.rows), self.columns)
        return self.spacing * np.stack([2 * column + row % 2, row, 0 * row], axis=1, dtype=np.float64)


Target = Chessboard | Charuco | Circles | AsymmetricCircles | AprilGrid


def has_two_ways_up(target: Target) -> bool:
    """True if the board looks the same after half a turn."""
    match target:
        case Chessboard():
            return (target.columns + target.rows) % 2 == 0
        case Circles():
            return True
        case _:
            return False


def outline(target: Target) -> Points:
    """Corners (4, 3) [m] of the rectangle of the print, clockwise from the upper left."""
    points, margin = target.points()[:, :2], target.margin
    (left, top), (right, bottom) = points.min(axis=0) - margin, points.max(axis=0) + margin
    return np.array([[left, top, 0], [right, top, 0], [right, bottom, 0], [left, bottom, 0]])


def _lattice(columns: int, rows: int, spacing: float) -> Points:
    row, column = np.divmod(np.arange(columns * rows), columns)
    return spacing * np.stack([column, row, 0 * row], axis=1, dtype=np.float64)


def _check_discs(columns: int, rows: int, spacing: float, diameter: float) -> None:
    check_counts(columns, rows, 3)
    check_length("spacing", spacing)
    check_length("diameter", diameter)
    if diameter >= spacing:
        raise TargetError(f"diameter: {diameter:g} m must be less than the spacing of {spacing:g} m")
