"""The method on one screen (Fig. 1 of the paper): deform, synthesise, compare, search."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from abs_service.observation import Observation
from abs_service.tracker import status, uncertainty
from abs_service.tracker.curvature import newton_step, search_metric, vertex_jacobian
from abs_service.tracker.estimate import Estimate
from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.objectives.base import Objective
from abs_service.tracker.optimizers.base import Optimizer
from abs_service.tracker.priors import MotionPrior, ShapePrior, StretchPrior
from abs_service.tracker.terms.base import Linearization, SensorFit, stack


class Tracker:
    """Finds the parameters Θ that explain an observation best, starting from the last one's.

    Attributes:
        model: the deformation that is searched.
    """

    def __init__(
        self,
        model: DeformationModel,
        objective: Objective,
        stretch: StretchPrior,
        shape: ShapePrior,
        motion: MotionPrior,
        optimizer: Optimizer,
        verdict: status.Settings,
    ):
        self.model = model
        self._objective = objective
        self._stretch = stretch
        self._shape = shape
        self._motion = motion
        self._optimizer = optimizer
        self._verdict = verdict

    def track(self, observation: Observation, in_time: Callable[[], bool]) -> Estimate:
        """Searches until the optimiser's generations are used up or `in_time` says no, after one at least."""
        self._motion.predict(observation.t_host_ns)
        self._objective.observe(observation, self.model.deform(self._motion.predicted[None]))
        start, metric = self._start(self._motion.predicted)
        self._optimizer.restart()
        generations = evaluations = 0
        while generations < self._optimizer.generations and (generations == 0 or in_time()):
            candidates = self._optimizer.ask()
            costs = self._cost(start + candidates @ metric.T)
            self._optimizer.tell(candidates, costs)
            generations += 1
            evaluations += len(candidates)
        theta = self._better(start, start + metric @ self._optimizer.mean)
        self._motion.update(theta)
        return self._estimate(observation, theta, generations, evaluations)

    def _start(self, predicted: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Where the search begins, the prediction or a Newton step from it, and the metric of its coordinates."""
        linear = self._linearize(predicted)
        metric = search_metric(linear.jacobian)
        step = newton_step(linear, metric)
        return self._better(predicted, predicted + step / 2, predicted + step), metric

    def _linearize(self, theta: NDArray[np.float64]) -> Linearization:
        """Likelihood and priors around theta (dim,); the motion's residuals are those of the prediction."""
        surface, jacobian = self.model.deform(theta[None]), vertex_jacobian(self.model, theta)
        parts = [
            self._objective.linearize(surface, jacobian),
            self._stretch.linearize(surface, jacobian),
            self._shape.linearize(theta),
            self._motion.linearize(),
        ]
        return stack(parts, len(theta))

    def _better(self, *thetas: NDArray[np.float64]) -> NDArray[np.float64]:
        """The parameters (dim,) of least cost."""
        return thetas[int(np.argmin(self._cost(np.stack(thetas))))]

    def _cost(self, thetas: NDArray[np.float64]) -> NDArray[np.float64]:
        """Negative logarithm (population,) of likelihood times priors."""
        surface = self.model.deform(thetas)
        priors = self._stretch.cost(surface) + self._shape.cost(thetas) + self._motion.cost(thetas)
        return self._objective.cost(surface) + priors

    def _estimate(
        self,
        observation: Observation,
        theta: NDArray[np.float64],
        generations: int,
        evaluations: int,
    ) -> Estimate:
        surface = self.model.deform(theta[None])
        metric = search_metric(self._linearize(theta).jacobian)
        covariance = metric @ metric.T
        fits = tuple(self._objective.fits(surface))
        share = _inlier_share(fits)
        verdict, reasons = status.judge(share, _hidden_share(fits), observation.missing, self._verdict)
        return Estimate(
            seq=observation.seq,
            t_host_ns=observation.t_host_ns,
            status=verdict,
            reasons=reasons,
            theta=theta,
            covariance=covariance,
            vertices=np.ascontiguousarray(surface.vertices[0].T),
            vertex_covariance=uncertainty.of_vertices(self.model, theta, surface, covariance),
            cost=float(self._cost(theta[None])[0]),
            deviation=self._optimizer.deviation,
            generations=generations,
            evaluations=evaluations,
            inlier_share=share,
            fits=fits,
            sources=observation.sources,
            missing=observation.missing,
        )


def _inlier_share(fits: tuple[SensorFit, ...]) -> float:
    """Share of the vertices visible to any sensor that agree with their measurement; 0 if none is visible."""
    visible = sum(fit.visible for fit in fits)
    return sum(fit.inliers for fit in fits) / visible if visible else 0.0


def _hidden_share(fits: tuple[SensorFit, ...]) -> float:
    """Share of the vertices that are hidden from the sensor that sees most of them; 0 without a sensor.

    A light barrier, whose one sample is no vertex, has no say.
    """
    shares = [fit.hidden / (fit.hidden + fit.visible) for fit in fits if fit.hidden + fit.visible > 1]
    return min(shares, default=0.0)
