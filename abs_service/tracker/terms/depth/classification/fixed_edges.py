"""Edges that stay where they are in the image while the rest of the outline does not: there the field of view ends.

An object alone before a background without return seems to end where the sensor's view does. One image does not tell
the two apart. Over time they differ: the end of an object moves in the image, and its outermost pixels come and go with
the noise; the end of a view is the same pixel for pixel in every image.
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Window, limits
from abs_service.tracker.terms.depth.classification.neighbourhood import grown

#: Pixels this near to the predicted mesh may be on the object's outline: a mesh ends up to a cell inside.
NEAR_PX = 16
#: A view ends within this share of the image's width or height from its sides. The corners that the hexagon of an Azure
#: Kinect leaves out are 0.24 wide; a part of a long edge farther inside may be fixed for another reason.
MARGIN = 0.15
#: A place of the outline is fixed if it was the same in so many later images, but for a share of them (dropouts).
MIN_IMAGES, LARGEST_CHANGED = 4, 0.1
#: An edge is fixed where so large a share of the outline in a cell of the image is [px], for so many pixels in a row.
#: A real Kinect v1's outline of a sheet that hands move is so for up to 16.
CELL_PX, MIN_SHARE, MIN_LENGTH, LARGEST_GAP = 16, 0.85, 24, 8
#: If less than this share of the outline changes, all of it stands still, and nothing can be told.
MIN_ELSEWHERE = 0.25
#: So many returns farther than this beyond an edge show that the sensor sees there [px].
MIN_RETURNS, BEYOND_PX = 10, 2

Coordinates = NDArray[np.intp]

#: Steps (row, column) from a pixel to its neighbours towards the left, right, upper and lower side of the image.
_STEPS = ((0, -1), (0, 1), (-1, 0), (1, 0))


class FixedEdges:
    """Pixels beyond fixed edges, learnt from the depth images so far."""

    def __init__(self) -> None:
        self._last = self._next = np.zeros((0, 2), np.intp)
        self._side = self._images = self._changed = np.zeros(0, np.intp)
        self._edges: list[tuple[NDArray[np.bool_], NDArray[np.bool_]]] = []
        self._shape = (0, 0)

    def observe(
        self, missing: NDArray[np.bool_], areas: NDArray[np.bool_], expected: NDArray[np.bool_], window: Window
    ) -> NDArray[np.bool_]:
        """Missing returns (rows, columns) beyond fixed edges; the first call learns where the outline is.

        Args:
            missing: pixels without return (rows, columns) in the window.
            areas: those of them that are no dropouts.
            expected: silhouette of the predicted mesh there.
            window: of the image; the first one has to be the whole image.
        """
        if not self._shape[0]:
            self._shape = missing.shape[0], missing.shape[1]
            self._last, self._next, self._side = _outline(areas, grown(expected, NEAR_PX))
            self._images, self._changed = np.zeros((2, len(self._side)), np.intp)
            return np.zeros(missing.shape, np.bool_)
        self._count(missing, window)
        self._learn()
        self._refute(missing, window)
        beyond = np.zeros(missing.shape, np.bool_)
        for edge, _ in self._edges:
            beyond |= missing & edge[window]
        return beyond

    def _count(self, missing: NDArray[np.bool_], window: Window) -> None:
        """Counts in how many images there was another outline at each place."""
        top, bottom, left, right = limits(window, self._shape)
        low, high = np.minimum(self._last, self._next), np.maximum(self._last, self._next)
        inside = (low >= (top, left)).all(axis=1) & (high < (bottom, right)).all(axis=1)
        last, beyond = (tuple((at[inside] - (top, left)).T) for at in (self._last, self._next))
        self._images[inside] += 1
        self._changed[inside] += missing[last] | ~missing[beyond]

    def _learn(self) -> None:
        """Finds the edges that are fixed, if the rest of the outline is not."""
        is_fixed = (self._images >= MIN_IMAGES) & (self._changed <= LARGEST_CHANGED * self._images)
        if np.count_nonzero(is_fixed) < MIN_LENGTH:
            return
        columns = self._shape[1] // CELL_PX + 1
        cell = self._last[:, 0] // CELL_PX * columns + self._last[:, 1] // CELL_PX
        all_of_it, fixed = np.bincount(cell), np.bincount(cell, is_fixed)
        lines_up = is_fixed & (fixed >= MIN_SHARE * all_of_it)[cell]
        if np.mean(~is_fixed[~lines_up]) < MIN_ELSEWHERE or lines_up.all():
            return
        for side in range(len(_STEPS)):
            known = np.any([self._is_on(edge) for edge, _ in self._edges] or [np.False_], axis=0)
            use = np.flatnonzero(lines_up & (self._side == side) & ~known)
            self._edges += [
                (_beyond(self._shape, side, run, 0), _beyond(self._shape, side, run, BEYOND_PX))
                for run in _runs(self._next[use], side, self._shape)
            ]

    def _refute(self, missing: NDArray[np.bool_], window: Window) -> None:
        """Forgets edges beyond which there is a return."""
        refuted = [np.count_nonzero(~missing & inner[window]) >= MIN_RETURNS for _, inner in self._edges]
        for (edge, _), is_refuted in zip(self._edges, refuted, strict=True):
            self._changed[self._is_on(edge)] += is_refuted * np.iinfo(np.int32).max
        self._edges = [edge for edge, is_refuted in zip(self._edges, refuted, strict=True) if not is_refuted]

    def _is_on(self, edge: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """True for places of the outline (k,) at which what is beyond an edge (height, width) begins."""
        return edge[self._next[:, 0], self._next[:, 1]]


def _outline(
    areas: NDArray[np.bool_], near: NDArray[np.bool_]
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Pixels (k, 2) at which returns end, the next ones (k, 2), and the sides of the image (k,) that these are towards.

    Args:
        areas: missing returns (height, width).
        near: where they are looked for.
    """
    (height, width), padded = areas.shape, np.pad(areas, 1)
    found = []
    for side, (down, right) in enumerate(_STEPS):
        beside = padded[1 + down : 1 + down + height, 1 + right : 1 + right + width]
        last = np.argwhere(near & ~areas & beside)
        found.append((last, last + np.array([down, right]), np.full(len(last), side, np.intp)))
    last, beyond, sides = (np.concatenate(part) for part in zip(*found, strict=True))
    return last, beyond, sides


def _from_side(rows: Coordinates, columns: Coordinates, side: int, shape: tuple[int, int]) -> tuple[Coordinates, ...]:
    """Distances from a side of an image, and places along it, of pixels at rows and columns [px]."""
    height, width = shape
    return ((columns, rows), (width - 1 - columns, rows), (rows, columns), (height - 1 - rows, columns))[side]


def _runs(places: NDArray[np.intp], side: int, shape: tuple[int, int]) -> list[NDArray[np.intp]]:
    """Connected ones of places (k, 2) near a side of an image, as (distance from the side, along it) (2, n)."""
    found = np.stack(_from_side(*places.T, side, shape))
    found = found[:, found[0] < _margin(side, shape)]
    found = found[:, np.argsort(found[1], kind="stable")]
    runs = np.split(found, np.flatnonzero(np.diff(found[1]) > LARGEST_GAP) + 1, axis=1)
    return [run for run in runs if len(np.unique(run[1])) >= MIN_LENGTH]


def _beyond(shape: tuple[int, int], side: int, run: NDArray[np.intp], by: int) -> NDArray[np.bool_]:
    """Pixels (height, width) near a side that are so far beyond the straight line through a run (2, n) of places.

    A field of view is convex, so all that is beyond a straight piece of its end is outside it.
    """
    slope, offset = np.polyfit(run[1], run[0], 1)
    away, along = _from_side(*np.ogrid[: shape[0], : shape[1]], side, shape)
    return np.asarray((away < slope * along + offset + (0.75 - by)) & (away < _margin(side, shape)))


def _margin(side: int, shape: tuple[int, int]) -> float:
    """Distance from a side within which a view may end [px]."""
    return MARGIN * (shape[1] if _STEPS[side][1] else shape[0])
