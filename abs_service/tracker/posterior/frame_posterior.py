"""The cost of theta for one frame: likelihood of its measurements times the priors (eq. 16)."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.memo import Memo
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.objectives.base import ObservedObjective
from abs_service.tracker.posterior.curvature import Quadratic, gauss_newton, posterior_covariance, solved
from abs_service.tracker.posterior.linearized_cost import LinearizedCost
from abs_service.tracker.posterior.optimum import Optimum
from abs_service.tracker.posterior.priors.motion_prediction import MotionPrediction
from abs_service.tracker.posterior.priors.shape_prior import ShapePrior
from abs_service.tracker.posterior.priors.stretch_prior import StretchPrior
from abs_service.tracker.posterior.relocation import fit_to_vertices
from abs_service.tracker.posterior.surfaces import FrameSurfaces
from abs_service.tracker.terms.photometric.matching import SIGNIFICANT
from abs_service.tracker.terms.places.keypoints import RIGID_PX, Recognized
from abs_service.tracker.terms.places.patches import Patches, is_beside
from abs_service.tracker.terms.sensor_fit import SensorFit

#: Gauss–Newton steps to the places of the appearance: under the motion prior, and under one that allows for the first.
MATCHING_STEPS = 2

#: Gauss–Newton steps by distances alone.
DISTANCE_STEPS = 5

#: Gauss–Newton steps to the places of keypoints: beside priors alone, which bring it near, and beside distances.
FAR_STEPS, RECOGNITION_STEPS = 6, 8

#: A surface is found where most of its keypoints are within this of theirs [px]; a search brings it nearer. And it has
#: been found if they are within a pixel.
FOUND_PX, THERE_PX = 10.0, 1.0


@dataclass(frozen=True, slots=True, eq=False)
class FramePosterior:
    """The cost of theta for one observation; a function of theta alone, in whatever order it is asked.

    Attributes:
        patches: of the vertices, whose appearance is looked for.
        recognitions: places of keypoints by objective and prediction.
    """

    objective: ObservedObjective
    stretch: StretchPrior
    shape: ShapePrior
    motion: MotionPrediction
    surfaces: FrameSurfaces
    patches: Patches
    recognitions: Memo[tuple[ObservedObjective, bytes], NDArray[np.float64] | None] = field(
        default_factory=Memo[tuple[ObservedObjective, bytes], NDArray[np.float64] | None]
    )

    @property
    def dimension(self) -> int:
        """Number of parameters."""
        return len(self.motion.theta)

    def allowing(self, theta: NDArray[np.float64]) -> "FramePosterior":
        """The same measurements under a motion prior that allows for theta (dim,)."""
        return self.with_motion(self.motion.widened(theta))

    def with_motion(self, motion: MotionPrediction) -> "FramePosterior":
        """The same measurements under another motion prior."""
        return replace(self, motion=motion)

    def cost(self, thetas: NDArray[np.float64], surface: Surface) -> NDArray[np.float64]:
        """Negative log-posterior (population,) [nats]."""
        priors = self.stretch.cost(surface) + self.shape.cost(thetas) + self.motion.cost(thetas)
        return self.objective.cost(surface) + priors

    def linearize(self, theta: NDArray[np.float64]) -> LinearizedCost:
        """The cost near theta (dim,)."""
        surface, sparse_jacobian = self.surfaces.with_jacobian(theta)
        sensed = self.objective.linearize(surface, sparse_jacobian)
        priors = self._priors(surface, sparse_jacobian, theta)
        quadratic = priors + gauss_newton(sensed, self.dimension)
        return LinearizedCost(theta, quadratic, priors.curvature, sensed, sparse_jacobian)

    def optimum(self, theta: NDArray[np.float64], known: LinearizedCost | None) -> Optimum:
        """The optimum at theta (dim,), with what is known of the cost nearby if that holds there."""
        near = known if known is not None and known.holds_at(theta) else self.linearize(theta)
        surface, sensed = self.surfaces.deform(theta[None]), near.sensed_at(theta)
        return Optimum(theta, surface, near, sensed, posterior_covariance(near.quadratic))

    def prior(self, theta: NDArray[np.float64]) -> Quadratic:
        """Gauss–Newton approximation of the priors alone near theta (dim,)."""
        surface, sparse_jacobian = self.surfaces.with_jacobian(theta)
        return self._priors(surface, sparse_jacobian, theta)

    def cross_curvature(self, theta: NDArray[np.float64], offsets: NDArray[np.float64]) -> NDArray[np.float64]:
        """JᵀJE (dim, n) at theta (dim,): derivatives with respect to theta, and to an offset (n, 3) [m] per vertex."""
        (surface, sparse_jacobian), each = self.surfaces.with_jacobian(theta), np.arange(len(offsets))
        single = SparseJacobian(
            np.ascontiguousarray(offsets[:, :, None]), each.astype(np.int32), each[:, None], len(each)
        )
        by_theta = self.objective.linearize(surface, sparse_jacobian)
        by_offset = self.objective.linearize(surface, single)
        pairs = zip(by_offset, by_theta)
        return np.sum([one.transposed_times(other.jacobian, len(each)) for one, other in pairs], axis=0).T

    def fits(self, theta: NDArray[np.float64]) -> tuple[SensorFit, ...]:
        """Agreement of every contributing sensor with theta (dim,)."""
        return tuple(self.objective.fits(self.surfaces.deform(theta[None])))

    def search_start(self) -> NDArray[np.float64]:
        """Start (dim,) of a search: the prediction, or where images show the appearance of the mesh beside it."""
        predicted = self.motion.theta
        matched = self._matched(predicted)
        return predicted if matched is None or not self._is_better(matched, predicted) else matched

    def cold_start(self) -> NDArray[np.float64]:
        """Start (dim,) of a search after a loss: the same, or where images show keypoints of the mesh."""
        start, recognized = self.search_start(), self.recognized()
        return start if recognized is None or not self._is_better(recognized, start) else recognized

    def shown_at(self, theta: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Place (dim,) where images show the appearance of the mesh: theta (dim,), the end of a search, or another.

        Print is looked for within some pixels: of theta, and of where distances alone would lay the mesh. They bring it
        nearer after a large motion, since colours beside their print agree by chance, and hold it there. Keypoints are
        recognised wherever they are. None if all this finds nothing better, and keypoints do not tell that theta is it.
        """
        without = self._by_distances()
        found = (self.recognized(), self._matched(theta), without, self._matched(without))
        better = [place for place in found if place is not None and self._is_better(place, theta)]
        if better:
            return min(better, key=lambda place: _cost(self.allowing(place), place))
        return theta if self._has_keypoints(theta, THERE_PX) else None

    def misfit(self, surface: Surface) -> NDArray[np.float64]:
        """Signed distance of each vertex from its measurements, and its deviation by noise (2, n) [m]."""
        return self.objective.misfit(surface)

    def learn(self, surface: Surface) -> None:
        """Takes the estimate in: what it shows of the sensors counts from the next frame on."""
        self.objective.learn(surface)

    def _priors(self, surface: Surface, sparse_jacobian: SparseJacobian, theta: NDArray[np.float64]) -> Quadratic:
        rows, precision = self.stretch.linearize(surface, sparse_jacobian), self.motion.precision
        motion = Quadratic(precision @ (theta - self.motion.theta), precision)
        return gauss_newton([*rows, self.shape.linearize(theta)], self.dimension) + motion

    def _matched(self, theta: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Parameters (dim,) where images show the patches of a mesh at theta (dim,); None if they are at theta."""
        places = self.objective.match(*self.surfaces.with_jacobian(theta), self.patches)
        if not is_beside(places):
            return None
        matched, wider = theta, self
        for _ in range(MATCHING_STEPS):
            moved = [part.moved(matched - theta) for part in places]
            quadratic = wider.linearize(matched).quadratic + gauss_newton(moved, self.dimension)
            matched = matched - solved(quadratic.curvature, quadratic.gradient)
            wider = self.allowing(matched)
        return matched

    def _by_distances(self) -> NDArray[np.float64]:
        """Theta (dim,) by distances alone, from the prediction on."""
        distances, theta = self._of_distances(), self.motion.theta
        for _ in range(DISTANCE_STEPS):
            quadratic = distances.linearize(theta).quadratic
            theta = theta - solved(quadratic.curvature, quadratic.gradient)
            distances = distances.allowing(theta)
        return theta

    def recognized(self) -> NDArray[np.float64] | None:
        """Theta (dim,) by keypoints and distances, however far from the prediction; None if keypoints do not tell."""
        # The width of the motion prior has no part in it, so all searches of a frame have the same.
        return self.recognitions.get((self.objective, self.motion.theta.tobytes()), lambda key: self._recognized())

    def _recognized(self) -> NDArray[np.float64] | None:
        found = self.objective.recognized
        if not found:
            return None
        theta = self._nearest_start(max(found, key=lambda one: len(one.seen)))
        try:
            theta = self._fitted(theta, found)
        except np.linalg.LinAlgError:  # wrong matches lead anywhere
            return None
        return theta if self._has_keypoints(theta, FOUND_PX) else None

    def _fitted(self, theta: NDArray[np.float64], found: Sequence[Recognized]) -> NDArray[np.float64]:
        """Theta (dim,) by keypoints, priors and at last distances, from a start (dim,) on."""
        distances = replace(self._of_distances(), motion=self.motion.around(theta))
        for step in range(FAR_STEPS + RECOGNITION_STEPS):
            rows = [one.linearize(*self.surfaces.with_jacobian(theta)) for one in found]
            beside = distances.prior(theta) if step < FAR_STEPS else distances.linearize(theta).quadratic
            quadratic = beside + gauss_newton(rows, self.dimension)
            theta = theta - solved(quadratic.curvature, quadratic.gradient)
        return theta

    def recognized_elsewhere(self, theta: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """The same if keypoints tell that the surface is not at theta (dim,)."""
        place = self.recognized()
        return None if place is None or self._has_keypoints(theta, FOUND_PX) else place

    def _nearest_start(self, found: Recognized) -> NDArray[np.float64]:
        """The prediction (dim,), or the undeformed mesh rigidly moved, whichever has its keypoints nearer to theirs."""
        model, predicted = self.surfaces.model, self.motion.theta
        moved = found.moved(model.mesh.vertices)
        if min(found.apart(self._vertices(predicted)), RIGID_PX) <= found.apart(moved):
            return predicted
        return fit_to_vertices(model, model.rest, moved)

    def _has_keypoints(self, theta: NDArray[np.float64], within_px: float) -> bool:
        """True if most keypoints of a mesh at theta (dim,) are recognised within some pixels of theirs."""
        vertices = self._vertices(theta)
        return any(found.apart(vertices) < within_px for found in self.objective.recognized)

    def _vertices(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        return self.surfaces.deform(theta[None]).vertices[0].T.astype(np.float64)

    def _of_distances(self) -> "FramePosterior":
        """The same priors, without the sensors that measure an appearance."""
        return replace(self, objective=self.objective.of_distances())

    def _is_better(self, theta: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
        """True if theta (dim,) is more likely than another under a motion prior that allows for it."""
        wider = self.allowing(theta)
        return _cost(wider, theta) < _cost(wider, other) - SIGNIFICANT


def _cost(frame: FramePosterior, theta: NDArray[np.float64]) -> float:
    """Cost of a single theta (dim,): a population would need the noise of all pixels around the prediction."""
    return float(frame.cost(theta[None], frame.surfaces.deform(theta[None]))[0])
