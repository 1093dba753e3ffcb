"""One frame of an outline: the free edges of a mesh compared with the end of the object in one depth image."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.memo import Memo
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.synthesis.perspective import project_with_jacobian
from abs_service.tracker.terms.depth.outline.rim import Edges, LocatedEdges, OutlineImage, chain
from abs_service.tracker.terms.depth.outline.rim_classes import MAX_GAP_STEPS
from abs_service.tracker.terms.depth.outline.rim_cost import MAX_DEVIATIONS
from abs_service.tracker.terms.depth.outline.rim_match import shift_to_outline
from abs_service.tracker.terms.depth.outline.rim_motion import by_side, displacement, motion
from abs_service.tracker.terms.depth.outline.rim_normal import across_rim
from abs_service.tracker.terms.depth.outline.round_outline import without_turn
from abs_service.tracker.terms.linearization import Linearization, PointLinearization
from abs_service.tracker.terms.places.patches import found_at
from abs_service.tracker.terms.sensor_fit import RimFit

#: Fewer vertices that hang over the outline, where the object went on at first, may be strays.
MIN_HANGING = 3


@dataclass(frozen=True, slots=True, eq=False)
class ObservedRimOutline:
    """Distances of the free edges from the outline, normal with zero mean and bounded; see `ObservedOutline`.

    Attributes:
        image: distances from the outline.
        edges: the free edges (k,) in sight.
        is_sure: False for those of them (k,) where the outline may be a silhouette, or the end of the field of view.
        hidden: number of free edges that the predicted mesh itself hides.
        covered: edges beyond which something hid the object in the first image, or that its border cut.
        along: unit directions of the rim in the image (k, 2) at the free edges, see `rim_directions`.
        is_round: the outline does not show a turn of the object in its plane.
        deviation: σ of the position of the outline [px].
        off_px: an edge that is farther from the outline is off it [px].
        lost_at: positive values (k,) at places (k, 2) in the image in areas that the sensor has lost.
        doubtful: pixels of the window (rows, columns) near the outline that are held against no vertex.
        kernel: `rim_cost` of the camera's lens.
        classes: of every vertex, as in `RimFit`.
        located: the free edges of those surfaces that were asked for, the predicted one among them.
    """

    image: OutlineImage
    edges: Edges
    is_sure: NDArray[np.bool_]
    hidden: int
    covered: Edges
    along: NDArray[np.float64]
    is_round: bool
    deviation: float
    off_px: float
    lost_at: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    doubtful: NDArray[np.bool_]
    kernel: Callable[..., None]
    classes: bytes = b""
    located: Memo[Surface, LocatedEdges] = field(default_factory=Memo[Surface, LocatedEdges])

    def cost(self, surface: Surface) -> NDArray[np.float64]:
        """Cost (population,) of every deformed mesh."""
        out, image = np.empty(len(surface.vertices)), self.image
        measured = image.inwards, image.corner, self.deviation
        self.kernel(surface.vertices, self.edges, image.projection.optics, *measured, out)
        return out

    def linearize(self, surface: Surface, sparse_jacobian: SparseJacobian) -> Linearization:
        """Normalised residuals of the free edges near the outline, and their derivatives with respect to theta."""
        points = self.edges.points(surface)
        values, gradients = self.image.look_at(points)
        residual, points = values / self.deviation, points[0].T
        use = (np.abs(residual) < MAX_DEVIATIONS).nonzero()[0]
        by_place = project_with_jacobian(self.image.camera, points[use].astype(np.float64))[1]
        shown = across_rim(gradients[use], self.along[use])
        shown = without_turn(shown, by_place, points[use]) if self.is_round else shown
        right, down = (shown / self.deviation).T[:, :, None]
        rows = right * by_place[:, 0] + down * by_place[:, 1]
        jacobian = np.zeros((len(use), sparse_jacobian.dimension))
        chain(rows, self.edges.some(use), sparse_jacobian.blocks, jacobian)
        residual = residual[use]
        shared = partial(_shared_by_side, jacobian, residual, gradients[use])
        return Linearization(residual, jacobian, points[use], rows, shared, partial(self._of_ends, surface, use))

    def _of_ends(self, surface: Surface, use: NDArray[np.intp], rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivatives (m, 3) of the edges `use`; zero where the outline is not known to be the end of the object.

        It is that of something else where there is no object within the mesh, as at the far side of a shadow. Edges
        whose side of the image is elsewhere for the most part are on the outline by chance.
        """
        edges = self._locate(surface)
        within = self.image.inside(edges.places - self.off_px * edges.directions)
        is_on, sides = (np.abs(edges.away) <= self.off_px) & ~(within < 0), by_side(edges.directions)
        most = 2 * (sides & is_on).sum(axis=1) > (sides & ~np.isnan(edges.away)).sum(axis=1)
        return rows * (self.is_sure & is_on & (most @ sides))[use, None]

    def match(self, surface: Surface, sparse_jacobian: SparseJacobian) -> PointLinearization:
        """Residuals of the places of outermost vertices, if a slide and a turn lay the edges on the outline."""
        edges = self._locate(surface)
        shift = shift_to_outline(self.image.look, edges.places, edges.directions)
        if not shift.any():
            return PointLinearization.empty(sparse_jacobian)
        return found_at(self.image.camera, surface.vertices[0].T, self.edges.outer, shift, sparse_jacobian)

    def fit(self, surface: Surface) -> RimFit:
        """Agreement of the edges of a population of one with the outline."""
        edges = self._locate(surface)
        known = ~np.isnan(edges.away)
        visible = int(np.count_nonzero(known))
        outside = edges.away < -self.off_px
        uncovered, hanging_m = self._of_covered(surface) if len(self.covered.outer) else (0, 0.0)
        return RimFit(
            visible=visible,
            outside=int(np.count_nonzero(outside)),
            lost=int(np.count_nonzero(self.lost_at(edges.places[outside]) > 0)) if outside.any() else 0,
            inside=int(np.count_nonzero(edges.away > self.off_px)),
            off_m=max(self._displacement(edges, known) if visible else 0.0, hanging_m),
            occluded=self.hidden + len(known) - visible,
            covered=len(self.covered.outer),
            uncovered=uncovered,
            classes=self.classes,
        )

    def _locate(self, surface: Surface) -> LocatedEdges:
        """The free edges of a population of one."""
        return self.located.get(surface, partial(self.image.locate, self.edges))

    def _displacement(self, edges: LocatedEdges, known: NDArray[np.bool_]) -> float:
        """The larger of `displacement` and `motion` [m] of free edges, of which some (k,) are known."""
        away, bound, directions = edges.away[known], MAX_DEVIATIONS * self.deviation, edges.directions[known]
        # Outside, distances are known up to there; how much farther, nothing tells.
        off_px = np.where(away < -self.off_px, -np.inf, np.where(away > self.off_px, away, 0.0))
        moved = motion(np.clip(away, -bound, bound), directions, edges.places[known])
        pixel_m = self._pixel_m(edges.points)
        typical_m = float(np.mean(pixel_m))
        off_m = displacement(off_px * pixel_m[known], directions, self.off_px * typical_m)
        return max(off_m, moved * typical_m)

    def _of_covered(self, surface: Surface) -> tuple[int, float]:
        """Number of covered edges of a population of one beyond which the object goes on, and `_hanging`."""
        outer, inner = self.covered.ends(surface), self.covered.starts(surface)
        beyond = self.image.inside_at(outer + MAX_GAP_STEPS * (outer - inner))
        return int(np.count_nonzero(beyond > 0)), self._hanging(outer, inner)

    def _hanging(self, outer: NDArray[np.float64], inner: NDArray[np.float64]) -> float:
        """∞ if covered edges, with vertices (m, 3) [m], hang over the outline on most of a side of the image, else 0.

        Then the mesh has slid, and nothing tells how far: how long the object is beyond them is not known.
        """
        places, before = (project_with_jacobian(self.image.camera, points)[0] for points in (outer, inner))
        away, sides = self.image.inside(places), by_side(places - before)
        over, known = ((sides & part).sum(axis=1) for part in (away < -self.off_px, ~np.isnan(away)))
        has_slid = np.any((over >= MIN_HANGING) & (2 * over > known))
        return np.inf if has_slid else 0.0

    def _pixel_m(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Size (k,) of a pixel at points (k, 3) [m]."""
        away = points - self.image.camera.center
        return np.sqrt(np.vecdot(away, away)) / self.image.camera.fx


def _shared_by_side(
    jacobian: NDArray[np.float64], residual: NDArray[np.float64], gradients: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Sums (4, dim) of the rows (k, dim) of edges that face one side of the image, times their shared deviation.

    It is one, that of the outline, or what the normalised residuals (k,) show: an edge that the mesh cannot follow is
    not where the outline says.

    Args:
        jacobian, residual: of the free edges.
        gradients: image gradients (k, 2) of their distances from the outline, which tell the side.
    """
    sides = by_side(gradients)
    mean_square = sides @ residual**2 / np.maximum(sides.sum(axis=1), 1)
    return np.sqrt(np.maximum(mean_square, 1.0))[:, None] * (sides @ jacobian)
