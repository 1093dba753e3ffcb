"""Start of a search: at the prediction, or where images show the appearance of the mesh, if that is beside it."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.posterior.curvature import gauss_newton, solved
from abs_service.tracker.posterior.frame_posterior import FramePosterior
from abs_service.tracker.terms.patches import Patches, is_beside
from abs_service.tracker.terms.photometric.matching import SIGNIFICANT

#: Gauss–Newton steps to the places of the appearance: under the motion prior, and under one that allows for the first.
STEPS = 2


def search_start(frame: FramePosterior, patches: Patches) -> tuple[FramePosterior, NDArray[np.float64]]:
    """Theta (dim,) that a search begins with, and the cost under a motion prior that allows for it.

    Args:
        frame: the cost around its prediction.
        patches: of the vertices, whose appearance is looked for.
    """
    predicted = frame.motion.theta
    places = frame.match(predicted, patches)
    if not is_beside(places):
        return frame, predicted
    matched, wider = predicted, frame
    for _ in range(STEPS):
        moved = [part.moved(matched - predicted) for part in places]
        quadratic = wider.linearize(matched).quadratic + gauss_newton(moved, frame.dimension)
        matched = matched - solved(quadratic.curvature, quadratic.gradient)
        wider = frame.with_motion(frame.motion.widened(matched))
    if _cost(wider, matched) > _cost(wider, predicted) - SIGNIFICANT:
        return frame, predicted
    return wider if frame.motion.is_too_narrow(matched) else frame, matched


def _cost(frame: FramePosterior, theta: NDArray[np.float64]) -> float:
    """Cost of a single theta (dim,): a population would need the noise of all pixels around the prediction."""
    return float(frame.cost(theta[None], frame.surfaces.deform(theta[None]))[0])
