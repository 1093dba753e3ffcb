"""AprilGrid: Kalibr's grid of AprilTags with a black square in every corner between them."""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.board.target_checks import TargetError, check_counts, check_extent, check_length

#: Width of a tag's black frame, and number of bits across it; Kalibr's family is tag36h11.
BORDER, BITS = 2, 6

#: OpenCV's dictionary; it stores tags turned by 180° relative to Kalibr's print.
TAGS = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)


def black_cells(
    image: NDArray[np.integer | np.floating], left: float, top: float, cell: float
) -> Iterator[tuple[float, float, float, float]]:
    """Left, top, width, height of the black parts of a marker, an image of its cells, at a place of the board [m].

    Adjacent cells of a row are one part, so that no gaps appear between them.
    """
    for row, line in enumerate(image < 128):
        ends = np.flatnonzero(np.diff(np.concatenate([[0], line.astype(int), [0]])))
        for begin, end in ends.reshape(-1, 2):
            yield left + begin * cell, top + row * cell, (end - begin) * cell, cell


@dataclass(frozen=True)
class AprilGrid:
    """Kalibr's AprilGrid; may be partly visible, with a unique orientation.

    Tag 0 is in the lower left corner, and numbers grow to the right and then upwards, as in Kalibr. The points are the
    corners of the tags; the black squares between them make each a meeting of four fields. As of the other boards, the
    first point is the upper left one.

    Attributes:
        columns, rows: tags along x and y.
        tag: edge length of a tag [m].
        gap: distance between two tags [m]: `tagSize` times `tagSpacing` of Kalibr.
    """

    columns: int
    rows: int
    tag: float
    gap: float

    def __post_init__(self) -> None:
        check_counts(self.columns, self.rows, 2)
        check_length("tag", self.tag)
        check_length("gap", self.gap)
        check_extent("tag", self.tag, max(self.columns, self.rows))
        if self.gap >= self.tag:
            raise TargetError(f"gap: {self.gap:g} m must be less than the tag of {self.tag:g} m")
        if self.columns * self.rows > len(TAGS.bytesList):
            raise TargetError(
                f"columns: {self.columns} × {self.rows} tags are more than the {len(TAGS.bytesList)} there are"
            )

    @property
    def grid(self) -> tuple[int, int]:
        """Columns and rows of points."""
        return 2 * self.columns, 2 * self.rows

    @property
    def margin(self) -> float:
        """Extent of the print beyond the outer points [m]."""
        return self.gap

    def points(self) -> NDArray[np.float64]:
        """Corners of tags row by row (n, 3) [m]."""
        x, y = (self._places(count) for count in (self.columns, self.rows))
        return np.stack([np.tile(x, len(y)), np.repeat(y, len(x)), np.zeros(len(x) * len(y))], axis=1)

    def ids_of_tag(self, number: int) -> NDArray[np.intp]:
        """Indices (4,) of the points of a tag, in the order of OpenCV's corners."""
        up, column = divmod(number, self.columns)
        left, top, width = 2 * column, 2 * (self.rows - 1 - up), 2 * self.columns
        # Clockwise from the lower right, which is OpenCV's upper left corner of the tag turned by 180°.
        return np.array([(top + dy) * width + left + dx for dx, dy in ((1, 1), (0, 1), (0, 0), (1, 0))], np.intp)

    def black_rectangles(self) -> NDArray[np.float64]:
        """Left, top, width, height of all black parts (n, 4) [m]."""
        cell = self.tag / (BITS + 2 * BORDER)
        found = [
            (x, y, self.gap, self.gap)
            for x in self._places(self.columns + 1)[::2] - self.gap
            for y in self._places(self.rows + 1)[::2] - self.gap
        ]
        points = self.points()
        for number in range(self.columns * self.rows):
            left, top = points[self.ids_of_tag(number)[2], :2]
            image = cv2.aruco.generateImageMarker(TAGS, number, BITS + 2 * BORDER, borderBits=BORDER)
            found += black_cells(np.rot90(image, 2), left, top, cell)
        return np.array(found)

    def _places(self, tags: int) -> NDArray[np.float64]:
        """Left and right edges of the tags in a row (2 tags,) [m]."""
        first = np.arange(tags, dtype=np.float64) * (self.tag + self.gap)
        return np.stack([first, first + self.tag], axis=1, dtype=np.float64).ravel()
