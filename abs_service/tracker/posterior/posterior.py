"""Likelihood and priors of one object over time (eq. 16); each frame has a posterior of its own."""

from dataclasses import dataclass

from abs_service.pairing.observation import Observation
from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.objectives.base import Objective
from abs_service.tracker.posterior.frame_posterior import FramePosterior
from abs_service.tracker.posterior.priors.motion_prediction import MotionPrediction
from abs_service.tracker.posterior.priors.motion_prior import MotionPrior
from abs_service.tracker.posterior.priors.shape_prior import ShapePrior
from abs_service.tracker.posterior.priors.stretch_prior import StretchPrior
from abs_service.tracker.posterior.surfaces import FrameSurfaces
from abs_service.tracker.terms.places.patches import Patches


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """Likelihood and priors of one object over time.

    Attributes:
        patches: of the vertices, whose appearance is looked for.
    """

    model: DeformationModel
    objective: Objective
    stretch: StretchPrior
    shape: ShapePrior
    motion: MotionPrior
    patches: Patches

    @property
    def dimension(self) -> int:
        """Number of parameters."""
        return len(self.model.rest)

    def observe(self, observation: Observation, prediction: MotionPrediction) -> FramePosterior:
        """Renders every noise model over its image around the predicted surface.

        Vertex offsets that the model has learnt since the last frame have moved its mesh at rest. Images are rendered
        into the memory of the last frame's, whose posterior answers no more.
        """
        self.stretch.rest_on(self.model.mesh.vertices)
        surfaces = FrameSurfaces(self.model)
        observed = self.objective.observe(observation, surfaces.deform(prediction.theta[None]), prediction.reach_m)
        return FramePosterior(observed, self.stretch, self.shape, prediction, surfaces, self.patches)
