"""An objective whose images do not tell where a search begins, for ablations: it begins at the motion prediction."""

from dataclasses import dataclass

import numpy as np

from abs_service.pairing.observation import Observation
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.objectives import likelihood
from abs_service.tracker.objectives.base import Objective, ObservedObjective
from abs_service.tracker.synthesis.base import Synthesizer
from abs_service.tracker.terms.linearization import PointLinearization
from abs_service.tracker.terms.places.keypoints import Recognized
from abs_service.tracker.terms.places.patches import Patches
from calib.rig import Rig


@dataclass(frozen=True)
class Settings:
    """The likelihood with its defaults, without matches."""

    def build(self, rig: Rig, mesh: Mesh, synthesizer: Synthesizer) -> "Unmatched":
        """The likelihood of a mesh in a rig."""
        return Unmatched(likelihood.Settings().build(rig, mesh, synthesizer))


@dataclass(frozen=True)
class Unmatched:
    """See `Objective`.

    Attributes:
        objective: the same with matches.
    """

    objective: Objective

    def observe(self, observation: Observation, predicted: Surface, reach_m: float = np.inf) -> "ObservedUnmatched":
        """The cost given an observation."""
        return ObservedUnmatched(self.objective.observe(observation, predicted, reach_m))


class ObservedUnmatched:
    """See `ObservedObjective`: that of an objective, but for its matches."""

    def __init__(self, observed: ObservedObjective):
        self.cost = observed.cost
        self.linearize = observed.linearize
        self.fits = observed.fits
        self.misfit = observed.misfit
        self.learn = observed.learn
        self.of_distances = observed.of_distances

    def match(self, surface: Surface, sparse_jacobian: SparseJacobian, patches: Patches) -> list[PointLinearization]:
        """No matches."""
        return []

    @property
    def recognized(self) -> list[Recognized]:
        """No keypoints."""
        return []
