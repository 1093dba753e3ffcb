"""The method of the paper on one page (Fig. 1): predict, observe, search by synthesis, covariance, status.

Initialisation, the detection of the object from which mesh and model are made, comes before (`tracking.plan`), and so
does renewed detection after a loss (`tracking.session`), which ends in `relocate` here if the mesh is kept.

Equation numbers: A. Jordt, R. Koch, Reconstruction of Deformation from Depth and Color Video with Explicit Noise
Models.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.observation import Observation
from abs_service.tracker.estimates import status
from abs_service.tracker.estimates.estimate import Estimate, SearchReport, Status
from abs_service.tracker.estimates.shape_quality import ShapeComparison
from abs_service.tracker.optimizers.base import Budget, Optimizer, Outcome, RunningSearch, Search, StartSearch
from abs_service.tracker.posterior.frame_posterior import FramePosterior
from abs_service.tracker.posterior.posterior import Posterior
from abs_service.tracker.posterior.relocation import fit_to_points
from abs_service.tracker.posterior.uncertainty import Uncertainty
from abs_service.tracker.terms.agreement import shows_other_colors

#: Frames after a start that are searched from scratch: in the first, nothing is known, and in the second, not how fast
#: the object moves.
COLD_FRAMES = 2

#: Searches of a frame after the first one: after a sudden motion, or where images show the surface elsewhere.
MORE_SEARCHES = 2

#: Reason of a loss whose object is in sight: it has come back, or moved further than objects do.
ELSEWHERE = "the keypoints of its print are seen elsewhere in the image – the next search begins there"


class Tracker:
    """Finds the parameters Θ of the largest posterior density for each observation.

    Args:
        posterior: likelihood and priors of a deformation model.
        optimizer: proposes candidates.
        evaluations: maximum number of cost evaluations per frame.
        limits: thresholds of the status.
        registration_m: standard deviation of the pose of a template's mesh; 0 if the first frame defines it [m].
        centers: centres of the imaging sensors, each (3,) [m].

    Attributes:
        model: the deformation model.
    """

    def __init__(
        self,
        posterior: Posterior,
        optimizer: Optimizer,
        evaluations: int,
        limits: status.Settings,
        registration_m: float = 0.0,
        centers: Sequence[NDArray[np.float64]] = (),
    ):
        self.model = model = posterior.model
        self._posterior = posterior
        self._motion = posterior.motion
        self._optimizer = optimizer
        self._evaluations = evaluations
        self._limits = limits.for_side(np.sqrt(model.mesh.area))
        self._uncertainty = Uncertainty(model, registration_m, centers)
        self._shape = ShapeComparison(model.mesh)
        self._frames = 0  # since the start or a relocation
        self._last_tracked = model.rest

    def track(self, observation: Observation, in_time: Callable[[], bool]) -> Estimate:
        """The estimate of one frame.

        Args:
            observation: the images of all sensors at one moment.
            in_time: False when the time is up; the first frame is searched to the end.
        """
        is_cold = self._frames < COLD_FRAMES
        prediction = self._motion.predict(observation.t_host_ns)  # predict: the motion prior of Θ
        frame = self._posterior.observe(observation, prediction)  # observe: noise models rendered per pixel
        start = frame.cold_start() if is_cold else frame.search_start()  # prediction, or where images show the print
        search = self._optimizer.explore if is_cold else self._optimizer.follow
        budget = Budget(self._evaluations, in_time if self._frames else lambda: True)
        frame, outcome = self._search(frame, search, start, budget)
        for _ in range(MORE_SEARCHES):
            if not outcome.is_start and not frame.motion.is_too_narrow(outcome.theta):
                break
            frame, outcome = self._search(frame, self._optimizer.follow, outcome.theta, budget)
        self._frames += 1
        return self._estimate(observation, frame, outcome, budget)

    def _search(
        self, frame: FramePosterior, search: StartSearch, start: NDArray[np.float64], budget: Budget
    ) -> tuple[FramePosterior, Outcome]:
        """The outcome of a search from start (dim,), and the frame under a motion prior that allows for the start."""
        if frame.motion.is_too_narrow(start):
            frame = frame.allowing(start)
        return frame, self._minimize(frame, search(frame, start, budget), budget)

    def _minimize(self, frame: FramePosterior, search: Search, budget: Budget) -> Outcome:
        """Analysis by synthesis: ask, deform, synthesise, score, tell, until budget or convergence ends the search."""
        running = RunningSearch(search)
        while running.outcome is None:
            thetas = running.ask()  # candidates (population, dim)
            surface = frame.surfaces.deform(thetas)  # deform: eqs. 2–8
            costs = frame.cost(thetas, surface)  # synthesise into every sensor (eqs. 10, 11, 20), score (eqs. 16–22)
            budget.evaluations += len(thetas)
            running.tell(costs)
        return running.outcome

    def _estimate(self, observation: Observation, frame: FramePosterior, outcome: Outcome, spent: Budget) -> Estimate:
        """The optimum with its covariances, the agreement of the sensors and the status."""
        optimum = frame.optimum(outcome.theta, outcome.linearized)
        motion = self._motion.update(frame.motion, optimum.theta, optimum.inverse_curvature)
        covariance = self._uncertainty.update(optimum, frame, motion)
        shape = self._shape.compare(
            optimum.vertices,
            covariance.without_drift,
            covariance.single_frame_deviation_m,
            covariance.no_outline_deviation_m,
        )
        fits = outcome.compared(frame).fits
        frame.learn(optimum.surface)
        verdict, reasons = status.judge(
            fits, observation.missing, shape, motion.innovation, self._limits, has_back=self.model.mesh.is_complete
        )
        if (verdict == Status.LOST or shows_other_colors(fits)) and self._restarts_elsewhere(frame, optimum.theta):
            verdict, reasons = Status.LOST, (*reasons, ELSEWHERE)
        if verdict == Status.TRACKING:
            self._last_tracked = optimum.theta
        return Estimate(
            seq=observation.seq,
            t_host_ns=observation.t_host_ns,
            sources=observation.sources,
            missing=observation.missing,
            status=verdict,
            reasons=reasons,
            theta=optimum.theta,
            covariance=covariance.theta,
            vertices=optimum.vertices,
            vertex_covariance=covariance.vertices,
            fits=fits,
            shape=shape,
            search=SearchReport.of(outcome, spent),
        )

    def relocate(self, points: NDArray[np.float64]) -> None:
        """Warm start from points (k, 3) [m] of a lost object: the next search begins with the mesh laid over them."""
        self._restart(fit_to_points(self.model, self._last_tracked, points))

    def _restarts_elsewhere(self, frame: FramePosterior, theta: NDArray[np.float64]) -> bool:
        """True if keypoints tell that the surface is not at theta (dim,): the next search begins where they are."""
        place = frame.recognized_elsewhere(theta)
        if place is not None:
            self._restart(place)  # the vertices keep their material points
        return place is not None

    def _restart(self, theta: NDArray[np.float64]) -> None:
        """The next search begins at theta (dim,), and nothing is known of the motion."""
        self._motion.restart(theta)
        self._uncertainty.restart(self._motion.longest_covariance)
        self._frames = 0
