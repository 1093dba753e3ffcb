"""Edges that stay where they are in the image while the rest of the outline does not: there the field of view ends.

An object alone before a background without return seems to end where the sensor's view does. One image does not tell
the two apart. Over time they differ: the end of an object moves in the image, and its outermost pixels come and go with
the noise; the end of a view is the same pixel for pixel in every image.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Window
from abs_service.tracker.detection.segments.neighbourhood import grown
from abs_service.tracker.synthesis.window import corner
from calib.jit import kernel

#: Pixels this near to the predicted mesh may be on the object's outline: a mesh ends up to a cell inside.
NEAR_PX = 16
#: A view ends within this share of the image's width or height from its sides. The corners that the hexagon of an Azure
#: Kinect leaves out are 0.24 wide; a part of a long edge farther inside may be fixed for another reason.
MARGIN = 0.15
#: Number of later images in which a fixed place of the outline is the same.
LATER_IMAGES = 4
#: Side of a cell of the image [px], and least share of the outline in it that is fixed; least length of such an edge,
#: and largest gap in it [px].
#: Dropouts of 2 % change a tenth of a fixed one. Of a sheet that hands bend before a real Kinect v1, far from the sides
#: of its image, an edge was so in 5 of 116 such series of images.
CELL_PX, MIN_SHARE, MIN_LENGTH, MAX_GAP = 16, 0.8, 24, 8
#: If no more than this share of the rest of the outline changes, all of it stands still, and nothing is known.
MIN_ELSEWHERE = 0.25
#: Number of returns in all images so far, and their least distance beyond an edge [px], that show that it is none.
MIN_RETURNS, BEYOND_PX = 10, 2.0
#: A place is unsettled if the same share of those that face the same side is fixed around it: up to these distances
#: along that side and across it. The last is the distance up to which the image around it is unsettled [px].
ALONG_PX, ACROSS_PX, AROUND_PX = 8, 2, 6
#: Largest distance of the first pixels beyond an edge from the line through them, to its inner side [px].
HALF_PX = 0.75
Coordinates = NDArray[np.intp]

#: That of an image without an area of missing returns, see `_outline`.
_NO_OUTLINE = np.zeros((0, 2), np.intp), np.zeros((0, 2), np.intp), np.zeros(0, np.intp)

#: Steps (row, column) from a pixel to its neighbours towards the left, right, upper and lower side of the image.
_STEPS = ((0, -1), (0, 1), (-1, 0), (1, 0))


class Edge(NamedTuple):
    """End of a field of view.

    Attributes:
        beyond: pixels (height, width) near a side of the image that are beyond it.
        far: those of them that are beyond it by more than `BEYOND_PX`.
    """

    beyond: NDArray[np.bool_]
    far: NDArray[np.bool_]


class FixedEdges:
    """Pixels beyond fixed edges, learnt from the depth images so far.

    Attributes:
        unsettled: pixels (height, width) around places near a side of the image where the object may end, or the field
            of view: the outline has not changed, and nothing has returned beyond. All of them in the first images.
    """

    def __init__(self) -> None:
        self.unsettled = np.ones((0, 0), np.bool_)
        self._last = self._next = np.zeros((0, 2), np.intp)
        self._side, self._is_fixed = np.zeros(0, np.intp), np.zeros(0, np.bool_)
        self._edges: list[Edge] = []
        self._returned = np.zeros((0, 0), np.bool_)
        self._later, self._begun = LATER_IMAGES, False

    def observe(
        self, missing: NDArray[np.bool_], areas: NDArray[np.bool_], expected: NDArray[np.bool_], window: Window
    ) -> NDArray[np.bool_]:
        """Missing returns (rows, columns) beyond fixed edges.

        Args:
            missing: pixels without return (rows, columns) in the window.
            areas: those of them that are no dropouts.
            expected: silhouette of the predicted mesh there.
            window: of the image; the first one has to be the whole image.
        """
        if not self._returned.size:
            self._returned, self.unsettled = ~missing, np.ones(missing.shape, np.bool_)
        self._returned[window] |= ~missing
        self._edges = [edge for edge in self._edges if not self._is_refuted(edge)]
        self._compare(missing, window)
        self._later += 1
        if self._later >= LATER_IMAGES:
            if self._begun:
                self._settle()
            self._learn()
            self._begin(areas, expected, window)
        beyond = np.zeros(missing.shape, np.bool_)
        for edge in self._edges:
            beyond |= missing & edge.beyond[window]
        return beyond

    def _begin(self, areas: NDArray[np.bool_], expected: NDArray[np.bool_], window: Window) -> None:
        """Takes the outline of this image for that with which later ones are compared."""
        last, beside, self._side = _outline(areas, grown(expected, NEAR_PX)) if areas.any() else _NO_OUTLINE
        self._last, self._next = last + corner(window), beside + corner(window)
        self._is_fixed, self._later = np.ones(len(last), np.bool_), 0
        self._begun = True

    def _compare(self, missing: NDArray[np.bool_], window: Window) -> None:
        """Finds the places at which the outline is another one, or out of the window."""
        compare_places(self._last, self._next, missing, corner(window), self._is_fixed)

    def _settle(self) -> None:
        """Finds the places at which the object may end, or the field of view."""
        self.unsettled = np.zeros(self._shape, np.bool_)
        near = np.flatnonzero(_is_near(self._next, self._side, self._shape))
        if not near.size:
            return
        places, side = self._last[near], self._side[near]
        is_fixed = self._is_fixed[near] & ~self._is_seen_beyond(places, side)
        apart = np.abs(places[:, None] - places)
        apart = np.where((side < 2)[:, None, None], apart, apart[..., ::-1])  # along the side, across it
        beside = (apart <= (ALONG_PX, ACROSS_PX)).all(axis=2) & (side[:, None] == side)
        fixed = np.count_nonzero(beside & is_fixed, axis=1)
        found = places[is_fixed & (fixed >= MIN_SHARE * np.count_nonzero(beside, axis=1))]
        for row, column in found.tolist():
            top, left = max(row - AROUND_PX, 0), max(column - AROUND_PX, 0)
            self.unsettled[top : row + AROUND_PX + 1, left : column + AROUND_PX + 1] = True

    def _is_seen_beyond(self, places: NDArray[np.intp], side: NDArray[np.intp]) -> NDArray[np.bool_]:
        """True for places (k, 2) beyond which, towards a side (k,) of the image, an image has had a return."""
        by = np.arange(int(BEYOND_PX), AROUND_PX + 1)
        beyond = places + by[:, None, None] * np.array(_STEPS)[side]
        inside = ((beyond >= 0) & (beyond < self._shape)).all(axis=2)
        rows, columns = np.clip(beyond, 0, np.array(self._shape) - 1).transpose(2, 0, 1)
        return np.asarray(np.count_nonzero(inside & self._returned[rows, columns], axis=0) > 1)

    def _learn(self) -> None:
        """Finds the edges that are fixed, if the rest of the outline is not."""
        is_fixed = self._is_fixed
        if np.count_nonzero(is_fixed & _is_near(self._next, self._side, self._shape)) < MIN_LENGTH:
            return
        columns = self._shape[1] // CELL_PX + 1
        cell = self._last[:, 0] // CELL_PX * columns + self._last[:, 1] // CELL_PX
        all_of_it, fixed = np.bincount(cell), np.bincount(cell, is_fixed)
        lines_up = is_fixed & (fixed >= MIN_SHARE * all_of_it)[cell]
        if np.count_nonzero(~is_fixed) <= MIN_ELSEWHERE * np.count_nonzero(~lines_up):
            return
        for side in range(len(_STEPS)):
            known = np.any([beyond[tuple(self._next.T)] for beyond, _ in self._edges] or [np.False_], axis=0)
            use = np.flatnonzero(lines_up & (self._side == side) & ~known)
            found = [_beyond(self._shape, side, run) for run in _runs(self._next[use], side, self._shape)]
            self._edges += [edge for edge in found if not self._is_refuted(edge)]

    @property
    def _shape(self) -> tuple[int, int]:
        return self._returned.shape[0], self._returned.shape[1]

    def _is_refuted(self, edge: Edge) -> bool:
        """True if there has been a return beyond an edge."""
        return bool(np.count_nonzero(self._returned & edge.far) >= MIN_RETURNS)


@kernel
def compare_places(
    last: NDArray[np.intp],
    beside: NDArray[np.intp],
    missing: NDArray[np.bool_],
    corner: tuple[int, int],
    is_fixed: NDArray[np.bool_],
) -> None:
    """Sets False at places where returns do not end as they did, or that are out of the window.

    Args:
        last, beside: last pixels with a return and those beyond (k, 2), in the image.
        missing: pixels without return (rows, columns) in the window, which begins at a corner (row, column).
        is_fixed: (k,).
    """
    (height, width), (top, left) = missing.shape, corner
    for k in range(is_fixed.size):
        y, x, next_y, next_x = last[k, 0] - top, last[k, 1] - left, beside[k, 0] - top, beside[k, 1] - left
        inside = min(y, next_y) >= 0 and max(y, next_y) < height and min(x, next_x) >= 0 and max(x, next_x) < width
        is_fixed[k] = is_fixed[k] and inside and not missing[y, x] and missing[next_y, next_x]


def _outline(
    areas: NDArray[np.bool_], near: NDArray[np.bool_]
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Pixels (k, 2) at which returns end, the next ones (k, 2), and the sides of the image (k,) that these are towards.

    Args:
        areas: missing returns (height, width).
        near: where they are looked for.
    """
    last, padded = np.argwhere(near & grown(areas, 1) & ~areas), np.pad(areas, 1)
    steps = np.array(_STEPS)
    beside = last[:, None] + steps
    which, sides = np.nonzero(padded[tuple((beside + 1).transpose(2, 0, 1))])
    return last[which], beside[which, sides], sides


def _from_side(
    at: tuple[Coordinates, Coordinates], side: int, shape: tuple[int, int]
) -> tuple[Coordinates, Coordinates]:
    """Distances from a side of an image, and places along it, of pixels at rows and columns [px]."""
    (rows, columns), (height, width) = at, shape
    return ((columns, rows), (width - 1 - columns, rows), (rows, columns), (height - 1 - rows, columns))[side]


def _is_near(places: NDArray[np.intp], side: NDArray[np.intp], shape: tuple[int, int]) -> NDArray[np.bool_]:
    """True for places (k, 2) near the side (k,) of an image (height, width) that they are towards."""
    away = np.array([_from_side((places[:, 0], places[:, 1]), one, shape)[0] for one in range(len(_STEPS))])
    margins = np.array([_margin(one, shape) for one in range(len(_STEPS))])
    return np.asarray(away[side, np.arange(len(side))] < margins[side])


def _runs(places: NDArray[np.intp], side: int, shape: tuple[int, int]) -> list[NDArray[np.intp]]:
    """Connected ones of places (k, 2) near a side of an image, as (distance from the side, along it) (2, n)."""
    found = np.stack(_from_side((places[:, 0], places[:, 1]), side, shape))
    found = found[:, found[0] < _margin(side, shape)]
    found = found[:, np.argsort(found[1], kind="stable")]
    runs = np.split(found, np.flatnonzero(np.diff(found[1]) > MAX_GAP) + 1, axis=1)
    return [run for run in runs if len(np.unique(run[1])) >= MIN_LENGTH]


def _beyond(shape: tuple[int, int], side: int, run: NDArray[np.intp]) -> Edge:
    """The end of a view at the straight line through a run (2, n) of places near a side of an image (height, width).

    A field of view is convex, so all that is beyond a straight piece of its end is outside it.
    """
    slope, offset = np.polyfit(run[1], run[0], 1)
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    away, along = _from_side((rows, columns), side, shape)
    by, near = slope * along + offset - away, away < _margin(side, shape)
    return Edge((by > -HALF_PX) & near, (by > BEYOND_PX) & near)


def _margin(side: int, shape: tuple[int, int]) -> float:
    """Distance from a side within which a view may end [px]."""
    return MARGIN * (shape[1] if _STEPS[side][1] else shape[0])
