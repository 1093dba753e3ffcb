"""The method of the paper on one page (Fig. 1): predict, observe, search by synthesis, posterior, status.

Equation numbers: A. Jordt, R. Koch, Reconstruction of Deformation from Depth and Color Video with Explicit Noise
Models.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.observation import Observation
from abs_service.tracker import status
from abs_service.tracker.estimate import Estimate, Status
from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.optimizers.base import Budget, Optimizer, Outcome, Search
from abs_service.tracker.posterior.posterior import FramePosterior, Posterior
from abs_service.tracker.posterior.relocation import fit_to_points
from abs_service.tracker.posterior.uncertainty import Uncertainty
from abs_service.tracker.shape_quality import ShapeJudge
from abs_service.tracker.terms.base import inlier_share


class Tracker:
    """Finds the parameters Θ that maximise the posterior density of every observation.

    Args:
        model: the deformation model.
        posterior: likelihood and priors.
        optimizer: proposes candidates.
        evaluations: maximum number of cost evaluations per frame.
        limits: thresholds of the status.
        placement_m: standard deviation of the place of the mesh at rest; 0 if the first frame defines it [m].

    Attributes:
        model: see above.
    """

    def __init__(
        self,
        model: DeformationModel,
        posterior: Posterior,
        optimizer: Optimizer,
        evaluations: int,
        limits: status.Settings,
        placement_m: float = 0.0,
    ):
        self.model = model
        self._posterior = posterior
        self._optimizer = optimizer
        self._evaluations = evaluations
        self._limits = limits
        self._uncertainty = Uncertainty(model, posterior.motion, placement_m)
        self._shape_judge = ShapeJudge(model.mesh)
        self._is_warm = False
        self._last_tracked = model.rest

    def track(self, observation: Observation, in_time: Callable[[], bool]) -> Estimate:
        """The estimate of one frame.

        Args:
            observation: the images of all sensors at one moment.
            in_time: False when the time is up; the first frame is searched to the end.
        """
        frame = self._posterior.observe(observation)  # predicts Θ; renders the noise models per pixel
        if self._is_warm:
            budget = Budget(self._evaluations, in_time)
            outcome = self._minimize(frame, self._optimizer.follow(frame, frame.predicted, budget), budget)
        else:
            budget = Budget(self._evaluations, lambda: True)
            outcome = self._minimize(frame, self._optimizer.explore(frame, frame.predicted, budget), budget)
        if self._posterior.motion.widen(outcome.theta):  # a sudden motion, for which the prior was too narrow
            outcome = self._minimize(frame, self._optimizer.follow(frame, outcome.theta, budget), budget)
        self._is_warm = True
        covariance = frame.covariance(outcome.theta)
        self._posterior.motion.update(outcome.theta, covariance)
        return self._estimate(observation, frame, outcome, budget, covariance)

    def relocate(self, points: NDArray[np.float64]) -> None:
        """Warm start from points (k, 3) [m] of a lost object: the next search begins with the mesh laid over them."""
        self._posterior.motion.restart(fit_to_points(self.model, self._last_tracked, points))
        self._uncertainty.relocate()
        self._is_warm = False

    def _minimize(self, frame: FramePosterior, search: Search, budget: Budget) -> Outcome:
        """Analysis by synthesis: ask, deform, synthesise and score, tell, until the search returns."""
        thetas = next(search)  # ask: candidates (population, dim)
        while True:
            surface = self.model.deform(thetas)  # eqs. 2–8
            costs = frame.cost(thetas, surface)  # synthesised into every sensor (eqs. 10–12) and scored (eqs. 16–22)
            budget.evaluations += len(thetas)
            try:
                thetas = search.send(costs)  # tell, and ask again
            except StopIteration as ended:
                return ended.value

    def _estimate(
        self,
        observation: Observation,
        frame: FramePosterior,
        outcome: Outcome,
        budget: Budget,
        covariance: NDArray[np.float64],
    ) -> Estimate:
        """Posterior covariance, agreement of the sensors and status at the optimum."""
        theta, surface = outcome.theta, self.model.deform(outcome.theta[None])
        vertices = np.ascontiguousarray(surface.vertices[0].T)
        known = self._uncertainty.estimate(frame, theta, surface, covariance)
        fits, shape = frame.fits(theta), self._shape_judge.judge(vertices, known.vertices, known.unheld_m)
        verdict, reasons = status.judge(fits, observation.missing, shape, self._posterior.motion.surprise, self._limits)
        if verdict == Status.TRACKING:
            self._last_tracked = theta
        return Estimate(
            seq=observation.seq,
            t_host_ns=observation.t_host_ns,
            status=verdict,
            reasons=reasons,
            theta=theta,
            covariance=known.theta,
            vertices=vertices,
            vertex_covariance=known.vertices,
            cost=outcome.cost,
            deviation=outcome.deviation,
            searcher=outcome.searcher,
            stop=outcome.stop,
            generations=budget.generations,
            evaluations=budget.evaluations,
            budget=self._evaluations,
            inlier_share=inlier_share(fits),
            fits=fits,
            shape=shape,
            sources=observation.sources,
            missing=observation.missing,
        )
