"""The cost of theta for one frame: likelihood of the measurements times the priors (eq. 16)."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.observation import Observation
from abs_service.tracker.models.base import DeformationModel, SparseJacobian, Surface
from abs_service.tracker.objectives.base import Objective
from abs_service.tracker.posterior.curvature import Quadratic, gauss_newton, posterior_covariance
from abs_service.tracker.posterior.priors.motion_prior import MotionPrior
from abs_service.tracker.posterior.priors.shape_prior import ShapePrior
from abs_service.tracker.posterior.priors.stretch_prior import StretchPrior
from abs_service.tracker.terms.base import SensorFit, inlier_share
from abs_service.tracker.terms.linearization import Part

#: A linearisation is reused within this many nats per parameter: the length of the last step of a descent, and half the
#: step that the noise of a frame causes.
REUSED_WITHIN = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Linearized:
    """The cost near one theta.

    Attributes:
        theta: the parameters (dim,).
        quadratic: likelihood and priors.
        priors: curvature (dim, dim) of the priors alone.
        sensed: residuals and derivatives of the sensors alone, by the origin of their errors, each in parts.
        sparse_jacobian: derivatives of the vertices.
    """

    theta: NDArray[np.float64]
    quadratic: Quadratic
    priors: NDArray[np.float64]
    sensed: list[list[Part]]
    sparse_jacobian: SparseJacobian


class Posterior:
    """Likelihood and priors of one object over time.

    Args:
        model: the deformation model.
        objective: sum of the sensors' terms.
        stretch, shape, motion: the priors.
    """

    def __init__(
        self,
        model: DeformationModel,
        objective: Objective,
        stretch: StretchPrior,
        shape: ShapePrior,
        motion: MotionPrior,
    ):
        self.dimension = len(model.rest)
        self.model = model
        self.objective = objective
        self.stretch = stretch
        self.shape = shape
        self.motion = motion

    def observe(self, observation: Observation) -> "FramePosterior":
        """Predicts theta, and renders every noise model over its image around the predicted surface.

        Vertex offsets that the model has learnt since the last frame have moved its mesh at rest.
        """
        self.stretch.rest_on(self.model.mesh.vertices)
        self.motion.predict(observation.t_host_ns)
        predicted = self.motion.predicted
        self.objective.observe(observation, self.model.deform(predicted[None]), self.motion.reach_m)
        return FramePosterior(self, predicted)


class FramePosterior:
    """The cost of theta for one observation; valid until the next one is observed.

    Args:
        posterior: likelihood and priors.
        predicted: prediction of the motion prior (dim,).

    Attributes:
        predicted: see above.
        dimension: number of parameters.
        linearized: the last linearisation of the search; None before the first.
    """

    def __init__(self, posterior: Posterior, predicted: NDArray[np.float64]):
        self.predicted = predicted
        self.dimension = posterior.dimension
        self.linearized: Linearized | None = None
        self._of = posterior
        self._fitted: tuple[NDArray[np.float64] | None, tuple[SensorFit, ...]] = (None, ())

    def cost(self, thetas: NDArray[np.float64], surface: Surface) -> NDArray[np.float64]:
        """Negative log-posterior (population,) [nats].

        Args:
            thetas: candidates (population, dim).
            surface: the mesh deformed by them.
        """
        of = self._of
        priors = of.stretch.cost(surface) + of.shape.cost(thetas) + of.motion.cost(thetas)
        return of.objective.cost(surface) + priors

    def linearize(self, theta: NDArray[np.float64]) -> Quadratic:
        """Gauss–Newton approximation of the cost near theta (dim,)."""
        of = self._of
        surface, sparse_jacobian = of.model.deform(theta[None]), of.model.sparse_jacobian(theta)
        terms = of.objective.linearize(surface, sparse_jacobian)
        sensed = [source.parts() for term in terms for source in term.sources()]
        priors = gauss_newton(self._priors(surface, sparse_jacobian, theta), self.dimension)
        quadratic = priors + gauss_newton([part for source in sensed for part in source], self.dimension)
        self.linearized = Linearized(theta, quadratic, priors.curvature, sensed, sparse_jacobian)
        return quadratic

    def linearized_near(self, theta: NDArray[np.float64]) -> Linearized:
        """A linearisation near theta (dim,) with its residuals moved there."""
        near = self._nearest(theta)
        step = theta - near.theta
        return replace(near, sensed=[[part.moved(step) for part in source] for source in near.sensed])

    def covariance(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Inverse curvature Σ (dim, dim) of the cost at the estimate theta (dim,), Laplace's approximation."""
        return posterior_covariance(self._nearest(theta).quadratic)

    def _nearest(self, theta: NDArray[np.float64]) -> Linearized:
        """The last linearisation if it is near theta (dim,), else a new one."""
        last = self.linearized
        if last is not None:
            step = theta - last.theta
            if 0.5 * step @ last.quadratic.curvature @ step < REUSED_WITHIN * self.dimension:
                return last
        self.linearize(theta)
        return self._nearest(theta)

    def prior(self, theta: NDArray[np.float64]) -> Quadratic:
        """Gauss–Newton approximation of the priors alone near theta (dim,)."""
        of = self._of
        surface, sparse_jacobian = of.model.deform(theta[None]), of.model.sparse_jacobian(theta)
        return gauss_newton(self._priors(surface, sparse_jacobian, theta), self.dimension)

    def cross_curvature(self, theta: NDArray[np.float64], offsets: NDArray[np.float64]) -> NDArray[np.float64]:
        """JᵀJE (dim, n) at theta (dim,): derivatives with respect to theta, and to an offset (n, 3) [m] per vertex."""
        of = self._of
        surface, each = of.model.deform(theta[None]), np.arange(len(offsets))
        single = SparseJacobian(
            np.ascontiguousarray(offsets[:, :, None]), each.astype(np.int32), each[:, None], len(each)
        )
        by_theta = of.objective.linearize(surface, of.model.sparse_jacobian(theta))
        by_offset = of.objective.linearize(surface, single)
        pairs = zip(by_offset, by_theta)
        return np.sum([one.transposed_times(other.jacobian, len(each)) for one, other in pairs], axis=0).T

    def fits(self, theta: NDArray[np.float64]) -> tuple[SensorFit, ...]:
        """Agreement of every contributing sensor with theta (dim,); computed once for the same array."""
        if self._fitted[0] is not theta:
            surface = self._of.model.deform(theta[None])
            self._fitted = (theta, tuple(self._of.objective.fits(surface)))
        return self._fitted[1]

    def misfit(self, surface: Surface) -> NDArray[np.float64]:
        """Signed distance of each vertex from its measurements, and its deviation by noise (2, n) [m]."""
        return self._of.objective.misfit(surface)

    def outlier_share(self, theta: NDArray[np.float64]) -> float:
        """Share of the visible vertices, over all sensors, that do not agree with their measurement at theta (dim,)."""
        return 1 - inlier_share(self.fits(theta))

    def _priors(self, surface: Surface, sparse_jacobian: SparseJacobian, theta: NDArray[np.float64]) -> list[Part]:
        of = self._of
        return [*of.stretch.linearize(surface, sparse_jacobian), of.shape.linearize(theta), of.motion.linearize(theta)]
