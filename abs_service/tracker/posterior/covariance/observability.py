"""Observability: what the measurements of a single frame show, and what they leave to the frames before.

The curvature of the cost without the motion prior tells the two apart.
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.posterior.curvature import solved, whitened
from abs_service.tracker.posterior.optimum import Optimum
from abs_service.tracker.posterior.priors.motion_prediction import MotionPrediction
from abs_service.tracker.terms.median import median

#: Share of the widest motion prior's precision that keeps `single_frame_deviation` finite, and number of vertices it
#: probes.
KEPT_PRIOR, PROBES = 1e-4, 24


def single_frame_deviation(optimum: Optimum, prediction: MotionPrediction) -> float:
    """Standard deviation [m] of a vertex by the measurements of one frame alone, median: large if unobservable.

    Args:
        optimum: the estimate of the frame.
        prediction: its motion prior, of which hardly anything is kept.
    """
    alone = _without_motion(optimum, prediction) + KEPT_PRIOR * prediction.least_precision
    derivatives = optimum.linearized.sparse_jacobian
    some = np.linspace(0, len(derivatives.local) - 1, PROBES).astype(np.intp)
    rows = np.zeros((PROBES, 3, len(alone)))
    np.put_along_axis(rows, derivatives.parameters[derivatives.group[some]][:, None], derivatives.local[some], axis=2)
    white = whitened(alone, rows.reshape(-1, len(alone)).T)
    return float(np.sqrt(median(np.einsum("ij,ij->j", white, white).reshape(PROBES, 3).sum(axis=1))))


def unobserved_motion(
    motion: NDArray[np.float64], optimum: Optimum, prediction: MotionPrediction
) -> NDArray[np.float64]:
    """The part (dim, dim) of a motion's covariance (dim, dim) that the measurements of a frame do not show.

    With the widest motion prior, the gain G tells how much of a motion the estimate lacks: next to nothing where
    something is measured, everything where nothing is. G⁸ tells the two apart. With a narrow prior, a single frame
    shows little of any motion, and several frames show it.

    Args:
        motion: covariance of the motion between two frames.
        optimum: the estimate of the frame.
        prediction: its motion prior.
    """
    least_precision = prediction.least_precision
    gain = solved(_without_motion(optimum, prediction) + least_precision, least_precision)
    gain = gain.astype(np.float32)  # enough for a share that only tells the two apart, in half the time
    for _ in range(3):
        gain = gain @ gain
    return np.asarray(gain @ motion.astype(np.float32) @ gain.T, np.float64)


def _without_motion(optimum: Optimum, prediction: MotionPrediction) -> NDArray[np.float64]:
    """Curvature (dim, dim) of likelihood and priors without the motion prior."""
    return optimum.linearized.quadratic.curvature - prediction.precision
