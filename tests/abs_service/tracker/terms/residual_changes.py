"""Changes of residuals, which their derivatives are compared with."""

import numpy as np

from abs_service.tracker.models.rigid import Rigid
from abs_service.tracker.terms.base import ObservedTerm
from abs_service.tracker.terms.linearization import stack


def central_difference(term: ObservedTerm, model: Rigid, theta: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Half of the change of all residuals between two steps in opposite directions."""
    ends = [
        stack(term.linearize(model.deform((theta + part)[None]), model.sparse_jacobian(theta)), 6).residual
        for part in (step, -step)
    ]
    return (ends[0] - ends[1]) / 2
