"""Outline of the object: the free edges of its mesh compared with the outline in depth images, one after the other.

Distances do not constrain a smooth surface that slides along itself; its outline does. A free edge belongs on the line
between the pixels on the object and those beside it. Which stretches of the rim are free edges is found in the first
image (`rim_classes`).
"""

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Window
from abs_service.tracker.memo import Memo
from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.perspective import project_with_jacobian
from abs_service.tracker.synthesis.projection import Projection
from abs_service.tracker.synthesis.window import WHOLE, corner
from abs_service.tracker.terms.depth.classification.fixed_edges import MARGIN
from abs_service.tracker.terms.depth.classification.outline_distance import inwards
from abs_service.tracker.terms.depth.classification.visibility import Visibility
from abs_service.tracker.terms.depth.outline.observed_outline import ObservedRimOutline
from abs_service.tracker.terms.depth.outline.raggedness import Raggedness
from abs_service.tracker.terms.depth.outline.rim import Edges, OutlineImage, Rim, read
from abs_service.tracker.terms.depth.outline.rim_classes import RimClass, classify_rim, turns_away
from abs_service.tracker.terms.depth.outline.rim_cost import MAX_DEVIATIONS, rim_cost
from abs_service.tracker.terms.depth.outline.rim_gap import exact_gap
from abs_service.tracker.terms.depth.outline.rim_normal import rim_directions
from abs_service.tracker.terms.depth.outline.round_outline import is_round
from calib.camera import Camera

#: Distance beside the object, in deviations, within which pixels are not held against a vertex: the rim is there.
UNJUDGED_DEVIATIONS = 3.0

#: Distance beyond which a free edge is off the outline, unless the bound of its cost is farther [px].
OFF_PX = 3.0

#: Least distance of the mesh's own surface in front of a vertex of the rim that it hides [m].
HIDDEN_BEHIND_M = 0.01

#: Largest distance from a free edge of an end of the field of view that cuts the object there [px].
BESIDE_PX = 2.0

#: Steps (column, row) towards the right, lower, left and upper side of the image.
_TO_SIDES = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])


class SortedEdges(NamedTuple):
    """The edges of a rim by their class.

    Attributes:
        is_cut: True for those (k,) that the view cuts.
        free: the free ones.
        covered: edges beyond which something hid the object in the first image, or that its border cut, or the view.
        classes: of every vertex, as in `RimFit`.
    """

    is_cut: NDArray[np.bool_]
    free: Edges
    covered: Edges
    classes: bytes


class RimOutline:
    """The outline of an object over time; each frame of it is an `ObservedRimOutline`.

    A mesh made from an image ends up to one cell inside the object. The gap is measured in the first image; from then
    on, the rim is that of the mesh extrapolated by this gap. Edges that face the same side of the image share their
    error: whether a sensor gives the mixed pixels of an edge a distance depends on the background and on the side.

    Args:
        camera: the camera.
        rim: outermost vertices.
        deviation: standard deviation of the position of the outline [px].
        ragged: the largest that it may be seen to have; no more than `deviation` if that is fixed [px].

    Attributes:
        classes: `RimClass` (k,) of every outer vertex, from the first image; all FREE before it.
    """

    def __init__(self, camera: Camera, rim: Rim, deviation: float, ragged: float = 0.0):
        self.classes = np.full(len(rim.outer), RimClass.FREE, np.uint8)
        self._camera = camera
        self._projection = Projection(camera)
        self._kernel = rim_cost(camera.lens)
        self._rim = rim
        self._edges = Edges(rim.outer, rim.inner, np.zeros(len(rim.outer), np.float32))
        self._first, self._was_cut = np.zeros((len(rim.outer), 2)), np.zeros(len(rim.outer), np.bool_)
        self._raggedness = Raggedness(deviation, ragged)
        self._sorted = SortedEdges(self._was_cut, self._edges, self._edges, b"")
        self._min_off_px = max(OFF_PX, MAX_DEVIATIONS * deviation)
        self._images, self._is_round, self._size = 0, False, (camera.width, camera.height)

    def observe(
        self,
        distance: NDArray[np.float32],
        seen: Visibility,
        expected: NDArray[np.float32],
        predicted: Surface,
        window: Window = WHOLE,
    ) -> ObservedRimOutline:
        """See `Outline`."""
        deviation, off_px = self._raggedness.deviation, max(self._min_off_px, self._raggedness.off_px)
        part, away = inwards(distance, seen, int(np.ceil(MAX_DEVIATIONS * deviation)) + 1)
        first = np.add(corner(window), corner(part))[::-1].astype(np.float32)
        image = OutlineImage(self._camera, self._projection, away, first)
        if not self._images:
            self._classify(image, predicted, distance)
        is_cut = self._find_cut(predicted, seen.beyond, window)
        if not (self._images and (is_cut is self._sorted.is_cut or np.array_equal(is_cut, self._sorted.is_cut))):
            self._sorted = self._sort(is_cut, predicted.vertices.shape[2])
        edges, hidden = self._in_sight(predicted, expected, window)
        located = image.locate(edges, predicted)
        self._is_round = self._is_round if self._images else is_round(self._camera, located.points, away, first)
        self._images += 1
        self._raggedness.update(located.away, located.directions, located.places)  # counts from the next frame on
        doubtful = np.zeros(distance.shape, np.bool_)
        doubtful[part] = (seen.free_m[part] > 0) & (away > -UNJUDGED_DEVIATIONS * deviation)
        return ObservedRimOutline(
            image=image,
            edges=edges,
            is_sure=self._are_ends(edges, predicted, located.places, distance, seen.unsettled, window),
            hidden=hidden,
            covered=self._sorted.covered,
            along=rim_directions(located.places, located.directions),
            is_round=self._is_round,
            deviation=deviation,
            off_px=off_px,
            lost_at=partial(self._read, seen.lost, window),
            doubtful=doubtful,
            kernel=self._kernel,
            classes=self._sorted.classes,
            located=Memo({predicted: located}),
        )

    def _sort(self, is_cut: NDArray[np.bool_], vertices: int) -> "SortedEdges":
        """The edges, of which the view cuts some (k,): at those, the mesh of so many vertices ends at a border."""
        hides = (self.classes == RimClass.OCCLUDED) | (self.classes == RimClass.BORDER)
        free = ((self.classes == RimClass.FREE) & ~is_cut).nonzero()[0]
        found = np.zeros(vertices, np.uint8)
        found[self._rim.outer] = 1 + np.where(is_cut, np.uint8(RimClass.BORDER), self.classes)
        covered = self._edges.some((hides | is_cut).nonzero()[0])
        return SortedEdges(is_cut, self._edges.some(free), covered, found.tobytes())

    def _read(
        self, part: NDArray[np.float32] | NDArray[np.bool_], window: Window, places: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Values (k,) of a window (rows, columns) at places (k, 2) in the image, see `read`; 1 in a mask."""
        first = np.array(corner(window)[::-1], np.float32)
        return read(part.astype(np.float32, copy=False), first, places, self._size)

    def _in_sight(self, predicted: Surface, expected: NDArray[np.float32], window: Window) -> tuple[Edges, int]:
        """Free edges that the predicted mesh does not hide, and the number of those that it hides; see `observe`."""
        ends = self._sorted.free.ends(predicted)
        in_front = self._read(expected, window, project_with_jacobian(self._camera, ends)[0])
        behind = in_front < np.linalg.norm(ends - self._camera.center, axis=1) - HIDDEN_BEHIND_M
        hidden = behind & (in_front > -np.inf)
        return self._sorted.free.some((~hidden).nonzero()[0]), int(np.count_nonzero(hidden))

    def _classify(self, image: OutlineImage, predicted: Surface, distance: NDArray[np.float32]) -> None:
        """Finds the free edges in the first image, and the gaps between them and the end of the object."""
        values, gradients = image.look_at(self._edges.points(predicted))
        measured = values, gradients, image.inside_at, distance
        self.classes, gap = classify_rim(self._camera, self._rim, predicted, *measured)
        outer, inner = self._edges.ends(predicted), self._edges.starts(predicted)
        gap = exact_gap(self._camera, outer, outer - inner, gap, image.look)
        self._edges = Edges(self._rim.outer, self._rim.inner, gap)
        self._first = self._beside(predicted)

    def _beside(self, surface: Surface) -> NDArray[np.float64]:
        """Places (k, 2) in the image of a population of one, `BESIDE_PX` outside the edges."""
        _, places, directions = self._edges.in_image(self._camera, surface)
        return places + BESIDE_PX * directions

    def _find_cut(self, surface: Surface, beyond: NDArray[np.bool_], window: Window) -> NDArray[np.bool_]:
        """True for edges (k,) where the field of view ends, at the first image's or at a population of one.

        Args:
            surface: the predicted mesh.
            beyond: pixels (rows, columns) in a window that lie beyond the field of view; none outside it is known.
            window: of the image.
        """
        if not (beyond.any() or self._was_cut.any()):
            return self._was_cut
        at_first, now = (self._read(beyond, window, places) for places in (self._first, self._beside(surface)))
        self._was_cut = np.where(np.isfinite(at_first), at_first > 0, self._was_cut)
        return self._was_cut | (now > 0)

    def _are_ends(
        self,
        edges: Edges,
        predicted: Surface,
        places: NDArray[np.float64],
        distance: NDArray[np.float32],
        unsettled: NDArray[np.bool_],
        window: Window,
    ) -> NDArray[np.bool_]:
        """True for edges at places (k, 2) where the outline is the object's end, and no silhouette or end of the view.

        The latter is doubted near a side of the image, if a window (rows, columns) has no return towards it, and as
        long as the outline there has been the same in every image.
        """
        are_ends = ~turns_away(self._camera, predicted, edges.outer, edges.inner)
        if not unsettled.any():
            return are_ends
        size = np.array(self._size)
        near = np.concatenate([places > (1 - MARGIN) * size, places < MARGIN * size], axis=1).T
        towards = [self._read(distance, window, places + BESIDE_PX * step) for step in _TO_SIDES]
        is_open = self._read(unsettled, window, places) > 0
        return are_ends & ~(is_open & np.any(near & ~np.isfinite(towards), axis=0))
