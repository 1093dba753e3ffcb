"""The method on one screen (Fig. 1 of the paper): deform, synthesise, compare, search."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from abs_service.observation import Observation
from abs_service.tracker import status
from abs_service.tracker.curvature import search_metric, vertex_jacobian
from abs_service.tracker.estimate import Estimate
from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.objectives.base import Objective
from abs_service.tracker.optimizers.base import Optimizer
from abs_service.tracker.priors import MotionPrior, StretchPrior
from abs_service.tracker.terms.base import SensorFit


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
        motion: MotionPrior,
        optimizer: Optimizer,
        verdict: status.Settings,
    ):
        self.model = model
        self._objective = objective
        self._stretch = stretch
        self._motion = motion
        self._optimizer = optimizer
        self._verdict = verdict

    def track(self, observation: Observation, in_time: Callable[[], bool]) -> Estimate:
        """Searches until the optimiser's generations are used up or `in_time` says no, after one at least."""
        self._objective.observe(observation)
        self._motion.predict(observation.t_host_ns)
        metric = self._search_metric(self._motion.predicted)
        self._optimizer.restart()
        generations = evaluations = 0
        while generations < self._optimizer.generations and (generations == 0 or in_time()):
            candidates = self._optimizer.ask()
            costs = self._cost(self._motion.predicted + candidates @ metric.T)
            self._optimizer.tell(candidates, costs)
            generations += 1
            evaluations += len(candidates)
        theta = self._motion.predicted + metric @ self._optimizer.mean
        self._motion.update(theta)
        return self._estimate(observation, theta, generations, evaluations)

    def _cost(self, thetas: NDArray[np.float64]) -> NDArray[np.float64]:
        """Negative logarithm (population,) of likelihood times priors."""
        surface = self.model.deform(thetas)
        return self._objective.cost(surface) + self._stretch.cost(surface) + self._motion.cost(thetas)

    def _search_metric(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        surface, jacobian = self.model.deform(theta[None]), vertex_jacobian(self.model, theta)
        rows = [
            self._objective.residual_jacobian(surface, jacobian),
            self._stretch.residual_jacobian(surface, jacobian),
            self._motion.residual_jacobian(),
        ]
        return search_metric(np.concatenate(rows))

    def _estimate(
        self, observation: Observation, theta: NDArray[np.float64], generations: int, evaluations: int
    ) -> Estimate:
        surface = self.model.deform(theta[None])
        fits = tuple(self._objective.fits(surface))
        share = _inlier_share(fits)
        verdict, reasons = status.judge(share, observation.missing, self._verdict)
        return Estimate(
            seq=observation.seq,
            t_host_ns=observation.t_host_ns,
            status=verdict,
            reasons=reasons,
            theta=theta,
            vertices=np.ascontiguousarray(surface.vertices[0].T),
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
