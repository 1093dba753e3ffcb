"""What a search minimises: the negative logarithm of likelihood times priors, for the observation in hand."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.observation import Observation
from abs_service.tracker.fused_cost import Chain, Step, step_of
from abs_service.tracker.models.base import DeformationModel, SparseJacobian, Surface
from abs_service.tracker.objectives.base import Objective
from abs_service.tracker.posterior.curvature import Quadratic, gauss_newton
from abs_service.tracker.posterior.priors import MotionPrior, ShapePrior
from abs_service.tracker.posterior.stretch_prior import StretchPrior
from abs_service.tracker.terms.base import SensorFit, inlier_share
from abs_service.tracker.terms.linearization import Linearization

#: Within so many nats per parameter of where it was made, a linearisation is as good as a new one: that is how far the
#: last step of a descent goes, and half of how far the noise of a frame throws the estimate.
NEAR = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Linearized:
    """The cost near one Θ.

    Attributes:
        theta: the parameters (dim,).
        quadratic: likelihood and priors.
        sensed: residuals of the sensors alone, and their derivatives.
        sparse_jacobian: derivative of the vertices with respect to theta.
    """

    theta: NDArray[np.float64]
    quadratic: Quadratic
    sensed: list[Linearization]
    sparse_jacobian: SparseJacobian


class Posterior:
    """The cost of Θ (eq. 16, with the priors as further terms); what the optimisers ask of it is `Problem`.

    Attributes:
        dimension: number of parameters.
        judge: what one candidate costs in this observation, if all parts can be steps of one compiled loop.
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
        self._model = model
        self._objective = objective
        self._stretch = stretch
        self._shape = shape
        self._motion = motion
        self._cost = self.cost_in_stages
        self.judge: Step | None = None
        self._linearized: list[Linearized] = []
        self._fitted: list[tuple[NDArray[np.float64], tuple[SensorFit, ...]]] = []

    def observe(self, observation: Observation) -> NDArray[np.float64]:
        """Turns to a new observation; the parameters (dim,) that the motion predicts for it."""
        self._linearized.clear()
        self._fitted.clear()
        self._motion.predict(observation.t_host_ns)
        predicted = self._motion.predicted
        self._objective.observe(observation, self._model.deform(predicted[None]), self._motion.reach_m)
        self._chain()
        return predicted

    def restart(self, theta: NDArray[np.float64]) -> None:
        """Expects the next observation's object near theta (dim,), wherever it was before."""
        self._motion.restart(theta)

    def settle(self, theta: NDArray[np.float64]) -> None:
        """Takes what was found for the observation (dim,), from which the next one's motion is predicted."""
        self._motion.update(theta)

    def cost(self, thetas: NDArray[np.float64]) -> NDArray[np.float64]:
        """Negative logarithm (population,) of likelihood times priors."""
        return self._cost(thetas)

    def cost_in_stages(self, thetas: NDArray[np.float64]) -> NDArray[np.float64]:
        """The same, found by each part for the whole population."""
        surface = self._model.deform(thetas)
        priors = self._stretch.cost(surface) + self._shape.cost(thetas) + self._motion.cost(thetas)
        return self._objective.cost(surface) + priors

    def linearize(self, theta: NDArray[np.float64]) -> Quadratic:
        """The cost near theta (dim,), by Gauss–Newton; asked again for the last theta, it answers at once."""
        if not (self._linearized and np.array_equal(self._linearized[0].theta, theta)):
            surface, sparse_jacobian = self._model.deform(theta[None]), self._model.sparse_jacobian(theta)
            sensed = [part for points in self._objective.linearize(surface, sparse_jacobian) for part in points.parts()]
            quadratic = gauss_newton([*sensed, *self._priors(surface, sparse_jacobian, theta)], self.dimension)
            self._linearized = [Linearized(theta, quadratic, sensed, sparse_jacobian)]
        return self._linearized[0].quadratic

    def linearized_near(self, theta: NDArray[np.float64]) -> Linearized:
        """The last linearisation with its residuals at theta (dim,) if that is `NEAR`, and a new one if it is not."""
        for last in self._linearized:
            by = theta - last.theta
            if 0.5 * by @ last.quadratic.curvature @ by < NEAR * self.dimension:
                return replace(last, sensed=[part.moved(by) for part in last.sensed])
        self.linearize(theta)
        return self._linearized[0]

    def answers(self, theta: NDArray[np.float64], offsets: NDArray[np.float64]) -> NDArray[np.float64]:
        """JᵀJE (dim, n) at theta (dim,): the sensors' derivatives by Θ, and by steps of single vertices (n, 3) [m]."""
        surface, each = self._model.deform(theta[None]), np.arange(len(offsets))
        alone = SparseJacobian(
            np.ascontiguousarray(offsets[:, :, None]), each.astype(np.int32), each[:, None], len(each)
        )
        by_theta = self._objective.linearize(surface, self._model.sparse_jacobian(theta))
        by_offset = self._objective.linearize(surface, alone)
        pairs = zip(by_offset, by_theta)
        return np.sum([one.transposed_times(other.jacobian, len(each)) for one, other in pairs], axis=0).T

    def prior(self, theta: NDArray[np.float64]) -> Quadratic:
        """The cost of the priors alone near theta (dim,): where the object may be, whatever the sensors say."""
        surface, sparse_jacobian = self._model.deform(theta[None]), self._model.sparse_jacobian(theta)
        return gauss_newton(self._priors(surface, sparse_jacobian, theta), self.dimension)

    def fits(self, theta: NDArray[np.float64]) -> tuple[SensorFit, ...]:
        """How every contributing sensor agrees with theta (dim,); the last theta's are remembered."""
        if not (self._fitted and np.array_equal(self._fitted[0][0], theta)):
            self._fitted = [(theta, tuple(self._objective.fits(self._model.deform(theta[None]))))]
        return self._fitted[0][1]

    def unexplained(self, theta: NDArray[np.float64]) -> float:
        """Share of the visible vertices, over all sensors, that do not agree with their measurement at theta (dim,)."""
        return 1 - inlier_share(self.fits(theta))

    def _chain(self) -> None:
        parts = self._model, self._stretch, self._shape, self._motion, self._objective
        steps = [step for part in parts if (step := step_of(part))]
        self._cost, self.judge = self.cost_in_stages, None
        if len(steps) == len(parts):
            chain = Chain(*steps)
            self._cost, self.judge = chain.cost, chain.judge

    def _priors(
        self, surface: Surface, sparse_jacobian: SparseJacobian, theta: NDArray[np.float64]
    ) -> list[Linearization]:
        return [
            *self._stretch.linearize(surface, sparse_jacobian),
            self._shape.linearize(theta),
            self._motion.linearize(theta),
        ]
