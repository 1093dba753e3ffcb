"""The method on one screen (Fig. 1 of the paper): deform, synthesise, compare, search."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.observation import Observation
from abs_service.tracker import status
from abs_service.tracker.estimate import Estimate, Status
from abs_service.tracker.models.base import DeformationModel, Surface
from abs_service.tracker.optimizers.base import Budget, Optimizer, Outcome
from abs_service.tracker.posterior.covariance import along_normals, propagated, remaining, sandwich
from abs_service.tracker.posterior.curvature import posterior_covariance
from abs_service.tracker.posterior.posterior import Posterior
from abs_service.tracker.posterior.relocation import laid_over
from abs_service.tracker.terms.base import SensorFit, inlier_share


class Tracker:
    """Finds the parameters Θ that explain an observation best, starting from the last one's.

    Attributes:
        model: the deformation that is searched.
    """

    def __init__(
        self,
        model: DeformationModel,
        posterior: Posterior,
        optimizer: Optimizer,
        evaluations: int,
        verdict: status.Settings,
    ):
        self.model = model
        self._posterior = posterior
        self._optimizer = optimizer
        self._evaluations = evaluations
        self._verdict = verdict
        self._started = False
        self._trusted = model.rest
        self._own = np.broadcast_to(model.mesh.deviation**2, len(model.mesh.vertices))
        self._knows_own = False

    def track(self, observation: Observation, in_time: Callable[[], bool]) -> Estimate:
        """Searches while evaluations are left and `in_time` allows; widely, and as long as it takes, the first time."""
        predicted = self._posterior.observe(observation)
        if self._started:
            budget = Budget(self._evaluations, in_time)
            found = self._optimizer.follow(self._posterior, predicted, budget)
            if not self._knows_own:
                self._own, self._knows_own = self._uncorrected(found.theta), True
        else:
            budget = Budget(self._evaluations, lambda: True)
            found = self._optimizer.explore(self._posterior, predicted, budget)
        self._started = True
        self._posterior.settle(found.theta)
        return self._estimate(observation, found, budget)

    def relocate(self, points: NDArray[np.float64]) -> None:
        """Takes points (k, 3) [m] for the object, which was lost: the next observation's search begins there."""
        self._posterior.restart(laid_over(self.model, self._trusted, points))
        self._started = False

    def _covariances(
        self, theta: NDArray[np.float64], surface: Surface
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Of theta (dim, dim) and of the vertices (n, 3, 3)."""
        near = self._posterior.linearized_near(theta)
        covariance = sandwich(posterior_covariance(near.quadratic), near.sensed)
        own = along_normals(surface, self._own)
        return covariance, propagated(near.sparse_jacobian, covariance) + own

    def _uncorrected(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Variance (n,) [m²] of the mesh's own noise along the normals that Θ does not correct.

        Told once for a mesh, because it hardly changes with the deformation; not in the first frame, where nothing may
        have moved and the priors let Θ correct nothing.
        """
        if not np.any(self.model.mesh.deviation):
            return self._own
        surface = self.model.deform(theta[None])
        normals = surface.normals[0].T.astype(np.float64)
        deviation = np.broadcast_to(self.model.mesh.deviation, len(normals))
        inverse = posterior_covariance(self._posterior.linearize(theta))
        response = -inverse @ self._posterior.answers(theta, normals * deviation[:, None])
        return remaining(normals, deviation, self.model.jacobian(theta), response)

    def _estimate(self, observation: Observation, found: Outcome, budget: Budget) -> Estimate:
        surface = self.model.deform(found.theta[None])
        covariance, vertex_covariance = self._covariances(found.theta, surface)
        fits = self._posterior.fits(found.theta)
        share = inlier_share(fits)
        verdict, reasons = status.judge(share, _hidden_share(fits), observation.missing, self._verdict)
        if verdict == Status.TRACKING:
            self._trusted = found.theta
        return Estimate(
            seq=observation.seq,
            t_host_ns=observation.t_host_ns,
            status=verdict,
            reasons=reasons,
            theta=found.theta,
            covariance=covariance,
            vertices=np.ascontiguousarray(surface.vertices[0].T),
            vertex_covariance=vertex_covariance,
            cost=found.cost,
            deviation=found.deviation,
            searcher=found.searcher,
            stop=found.stop,
            generations=budget.generations,
            evaluations=budget.evaluations,
            budget=self._evaluations,
            inlier_share=share,
            fits=fits,
            sources=observation.sources,
            missing=observation.missing,
        )


def _hidden_share(fits: tuple[SensorFit, ...]) -> float:
    """Share of the vertices that are hidden from the sensor that sees most of them; 0 without a sensor.

    A light barrier, whose one sample is no vertex, has no say.
    """
    shares = [fit.hidden / (fit.hidden + fit.visible) for fit in fits if fit.hidden + fit.visible > 1]
    return min(shares, default=0.0)
