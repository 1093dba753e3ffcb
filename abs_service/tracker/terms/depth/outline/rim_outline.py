"""Outline of the object: the free edges of its mesh compared with the outline in a depth image.

Distances do not constrain a smooth surface that slides along itself; its outline does. A free edge belongs on the line
between the pixels on the object and those beside it. Which stretches of the rim are free edges is found in the first
image (`rim_classes`).
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Window
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.synthesis.perspective import project_with_jacobian
from abs_service.tracker.synthesis.projection import Projection
from abs_service.tracker.synthesis.window import WHOLE, corner
from abs_service.tracker.terms.depth.classification.outline_distance import inwards
from abs_service.tracker.terms.depth.classification.visibility import Visibility
from abs_service.tracker.terms.depth.outline.raggedness import Raggedness
from abs_service.tracker.terms.depth.outline.rim import (
    Rim,
    by_side,
    chain,
    extrapolate_rim,
    is_behind,
    look_up,
    read,
    shared_by_side,
)
from abs_service.tracker.terms.depth.outline.rim_classes import LARGEST_GAP_STEPS, RimClass, classify_rim
from abs_service.tracker.terms.depth.outline.rim_cost import FARTHEST, rim_cost
from abs_service.tracker.terms.depth.outline.rim_gap import exact_gap
from abs_service.tracker.terms.depth.outline.rim_match import shift_to_outline
from abs_service.tracker.terms.depth.outline.rim_motion import displacement, motion
from abs_service.tracker.terms.depth.outline.rim_normal import across_rim, rim_directions
from abs_service.tracker.terms.depth.outline.round_outline import is_round, without_turn
from abs_service.tracker.terms.linearization import Linearization, PointLinearization
from abs_service.tracker.terms.patches import found_at
from abs_service.tracker.terms.sensor_fit import RimFit
from calib.camera import Camera

#: Beside the object, pixels nearer to it than so many deviations are not held against a vertex: the rim is there.
UNJUDGED_DEVIATIONS = 3.0

#: A free edge is off the outline if it is farther from it than so many pixels, and than the bound of its cost.
OFF_PX = 3.0

#: Fewer vertices that hang over the outline, where the object went on at first, may be strays.
MIN_HANGING = 3

#: Outer and inner vertices and share of a rim.
Ends = tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float32]]


class RimOutline:
    """The distances of the free edges from the outline are normal with zero mean, and bounded as outliers are.

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
        self._rim_cost = rim_cost(camera.lens)
        self._rim = rim
        self._raggedness = Raggedness(deviation, ragged)
        self._deviation, self._bound = deviation, FARTHEST * deviation
        self._usually_off = self._far = max(OFF_PX, self._bound)
        self._inwards = np.zeros((0, 0), np.float32)
        self._corner = np.zeros(2, np.float32)
        self._beyond = np.zeros(len(rim.outer), np.float32)
        self._ends: Ends = (rim.outer, rim.inner, self._beyond)
        self._along = np.zeros((len(rim.outer), 2))
        self._hidden, self._begun, self._is_round = 0, False, False

    def observe(
        self,
        distance: NDArray[np.float32],
        seen: Visibility,
        expected: NDArray[np.float32],
        predicted: Surface,
        window: Window = WHOLE,
    ) -> NDArray[np.bool_]:
        """Sets the outline from a window of a depth image; the mask of pixels that serve for the outline only."""
        self._deviation = self._raggedness.deviation
        self._bound, self._far = FARTHEST * self._deviation, max(self._usually_off, self._raggedness.off_px)
        part, self._inwards = inwards(distance, seen, int(np.ceil(self._bound)) + 1)
        self._corner = np.add(corner(window), corner(part))[::-1].astype(np.float32)
        if not self._begun:
            _, values, gradients = self._locate(predicted)
            measured = values, gradients, self._inside_at, distance
            self.classes, gap = classify_rim(self._camera, self._rim, predicted, *measured)
            outer, inner = (
                predicted.vertices[0].T[which].astype(np.float64) for which in (self._rim.outer, self._rim.inner)
            )
            self._beyond = exact_gap(self._camera, outer, outer - inner, gap, self._look)
        free = np.flatnonzero(self.classes == RimClass.FREE)
        ends = predicted.vertices[0].T[self._rim.outer[free]].astype(np.float64)
        visible = free[~is_behind(self._camera, ends, expected, window)]
        self._ends = self._rim.outer[visible], self._rim.inner[visible], self._beyond[visible]
        if not self._begun:
            edges = self._points(predicted)[0].T.astype(np.float64)
            self._is_round = is_round(self._camera, edges, self._inwards, self._corner)
            self._begun = True
        self._hidden = len(free) - len(visible)
        _, places, away = self._edges(predicted)
        directions = self._directions(predicted, places)
        self._along = rim_directions(places, directions)
        self._raggedness.update(away, directions, places)
        beside = np.zeros(distance.shape, np.bool_)
        beside[part] = (seen.free_m[part] > 0) & (self._inwards > -UNJUDGED_DEVIATIONS * self._deviation)
        return beside

    def cost(self, surface: Surface) -> NDArray[np.float64]:
        """Cost (population,) of every deformed mesh."""
        out = np.empty(len(surface.vertices))
        ends_and_optics = *self._ends, *self._projection.arguments
        self._rim_cost(surface.vertices, self._deviation, *ends_and_optics, self._corner, self._inwards, out)
        return out

    def linearize(self, surface: Surface, sparse_jacobian: SparseJacobian) -> Linearization:
        """Normalised residuals of the free edges near the outline, and their derivatives with respect to theta."""
        points, values, gradients = self._locate(surface)
        residual = values / self._deviation
        use = np.flatnonzero(np.abs(residual) < FARTHEST)
        by_place = project_with_jacobian(self._camera, points[use].astype(np.float64))[1]
        shown = across_rim(gradients[use], self._along[use])
        shown = without_turn(shown, by_place, points[use]) if self._is_round else shown
        rows = np.einsum("vi,vij->vj", shown / self._deviation, by_place)
        outer, inner, beyond = self._ends
        jacobian = np.zeros((len(use), sparse_jacobian.dimension))
        of_points = sparse_jacobian.group, sparse_jacobian.parameters, sparse_jacobian.local
        chain(rows, outer[use], inner[use], beyond[use], *of_points, jacobian)
        shared = shared_by_side(jacobian, residual[use], gradients[use])
        return Linearization(residual[use], jacobian, points[use], rows, shared)

    def match(self, surface: Surface, sparse_jacobian: SparseJacobian) -> PointLinearization:
        """Residuals of the places of outermost vertices, if a slide and a turn lay the edges on the outline."""
        _, places, _ = self._edges(surface)
        shift = shift_to_outline(self._look, places, self._directions(surface, places))
        if not shift.any():
            return PointLinearization.empty(sparse_jacobian)
        return found_at(self._camera, surface.vertices[0].T, self._ends[0], shift, sparse_jacobian)

    def fit(self, surface: Surface) -> RimFit:
        """Agreement of the edges of a population of one with the outline."""
        points, places, away = self._edges(surface)
        known = ~np.isnan(away)
        pixel_m = np.linalg.norm(points - self._camera.center, axis=1) / self._camera.fx
        covered = np.flatnonzero((self.classes == RimClass.OCCLUDED) | (self.classes == RimClass.BORDER))
        beyond = self._beyond_gap(surface, covered)
        hanging = self._hanging(surface, covered)
        return RimFit(
            visible=int(np.count_nonzero(known)),
            outside=int(np.count_nonzero(away < -self._far)),
            inside=int(np.count_nonzero(away > self._far)),
            off_m=max(self._displacement(surface, places, away, pixel_m) if known.any() else 0.0, hanging),
            occluded=self._hidden + int(np.count_nonzero(~known)),
            covered=len(covered),
            uncovered=int(np.count_nonzero(beyond > 0)),
        )

    def _edges(self, surface: Surface) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Free edges in sight (k, 3) [m], places in the image (k, 2) and distances inside the outline (k,) [px]."""
        points = self._points(surface)[0].T.astype(np.float64)
        places = project_with_jacobian(self._camera, points)[0]
        return points, places, self._inside(places)

    def _displacement(
        self, surface: Surface, places: NDArray[np.float64], away: NDArray[np.float64], pixel_m: NDArray[np.float64]
    ) -> float:
        """The larger of `displacement` and `motion` [m], of free edges at places (k, 2) and distances (k,) [px]."""
        known = ~np.isnan(away)
        directions = self._directions(surface, places)[known]
        # Outside, distances are known up to there; how much farther, nothing tells.
        off_px = np.where(away < -self._far, -np.inf, np.where(away > self._far, away, 0.0))
        moved = motion(np.clip(away[known], -self._bound, self._bound), directions, places[known])
        typical_m = float(np.mean(pixel_m))
        return max(displacement(off_px[known] * pixel_m[known], directions, self._far * typical_m), moved * typical_m)

    def _directions(self, surface: Surface, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Directions out of the mesh in the image (k, 2), at the edges' places (k, 2) [px]."""
        inner = surface.vertices[0].T[self._ends[1]].astype(np.float64)
        return places - project_with_jacobian(self._camera, inner)[0]

    def _hanging(self, surface: Surface, which: NDArray[np.intp]) -> float:
        """Distance [m] by which outer vertices (m,), beyond which the object went on, hang over its outline at least.

        0 unless most of a side of the image do: then the mesh has slid, and nothing tells how far.
        """
        vertices = surface.vertices[0].T.astype(np.float64)
        outer, inner = vertices[self._rim.outer[which]], vertices[self._rim.inner[which]]
        places = project_with_jacobian(self._camera, outer)[0]
        away = self._inside(places)
        sides = by_side(places - project_with_jacobian(self._camera, inner)[0])
        over, known = (np.count_nonzero(sides & part, axis=1) for part in (away < -self._far, ~np.isnan(away)))
        pixel_m = np.linalg.norm(outer - self._camera.center, axis=1) / self._camera.fx
        return float(self._far * pixel_m.mean()) if np.any((over >= MIN_HANGING) & (2 * over > known)) else 0.0

    def _beyond_gap(self, surface: Surface, which: NDArray[np.intp]) -> NDArray[np.float64]:
        """Distances inside the outline (m,) the largest gap beyond outer vertices (m,), see `_inside_at`."""
        vertices = surface.vertices[0].T.astype(np.float64)
        outer, inner = vertices[self._rim.outer[which]], vertices[self._rim.inner[which]]
        return self._inside_at(outer + LARGEST_GAP_STEPS * (outer - inner))

    def _inside_at(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance inside the outline (k,) of points (k, 3) [px]: −∞ far outside, NaN if unknown."""
        return self._inside(project_with_jacobian(self._camera, points)[0])

    def _inside(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """`_inside_at` of points at places in the image (k, 2) [px]."""
        return read(self._inwards, self._corner, places, (self._camera.width, self._camera.height))

    def _look(self, places: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Distances (k,) of places (k, 2) inside the outline [px], interpolated, and their image gradients (k, 2)."""
        values, gradients = np.empty(len(places)), np.empty((len(places), 2))
        look_up(self._inwards, places - self._corner, values, gradients)
        return values, gradients

    def _points(self, surface: Surface) -> NDArray[np.float32]:
        """Extrapolated rim (1, 3, k) [m]."""
        points = np.empty((1, 3, len(self._ends[0])), np.float32)
        extrapolate_rim(surface.vertices, *self._ends, points)
        return points

    def _locate(self, surface: Surface) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.float64]]:
        """Extrapolated rim (k, 3) [m], its distances inside the outline (k,) [px], and their image gradients (k, 2)."""
        points, k = self._points(surface), len(self._ends[0])
        (place,), (inverse_z,) = self._projection.project(points)
        place[np.isnan(inverse_z)] = np.nan
        values, gradients = np.empty(k), np.empty((k, 2))
        look_up(self._inwards, place - self._corner, values, gradients)
        return points[0].T, values, gradients
