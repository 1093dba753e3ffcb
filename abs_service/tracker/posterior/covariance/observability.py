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
    alone = _with_widest(optimum, prediction, KEPT_PRIOR)
    derivatives, dimension = optimum.linearized.sparse_jacobian, len(alone)
    some = np.arange(PROBES) * (len(derivatives.local) - 1) // (PROBES - 1)
    rows = np.zeros((PROBES, dimension, 3))
    own = derivatives.parameters[derivatives.group[some]]
    rows[np.arange(PROBES)[:, None], own] = derivatives.local[some].transpose(0, 2, 1)
    white = whitened(alone, rows.transpose(1, 0, 2).reshape(dimension, -1))
    return float(np.sqrt(median(np.square(white).sum(axis=0).reshape(PROBES, 3).sum(axis=1))))


def unobserved_motion(
    motion: NDArray[np.float64], optimum: Optimum, prediction: MotionPrediction
) -> NDArray[np.float64]:
    """The part (dim, dim) of a motion's covariance (dim, dim) that the measurements of a frame do not show.

    With the widest motion prior, the gain G tells how much of a motion the estimate lacks: next to nothing where
    something is measured, everything where nothing is. G⁸ tells the two apart. With a narrow prior, a single frame
    shows little of any motion, and several frames show it.
    """
    gain = solved(_with_widest(optimum, prediction, 1.0), prediction.minimum_precision)
    gain = gain.astype(np.float32)  # enough for a share that only tells the two apart, in half the time
    for _ in range(3):
        gain = gain @ gain
    return np.asarray(gain @ motion.astype(np.float32) @ gain.T, np.float64)


def held_back(optimum: Optimum, prediction: MotionPrediction) -> NDArray[np.float64]:
    """Change (dim,) of the estimate by which the motion prior has held it back, to first order.

    An object that moves otherwise than was predicted does so for some frames, to the same side: this is no noise that
    its covariance has already.
    """
    return optimum.inverse_curvature @ (prediction.precision @ (optimum.theta - prediction.theta))


def _with_widest(optimum: Optimum, prediction: MotionPrediction, share: float) -> NDArray[np.float64]:
    """Curvature (dim, dim) of likelihood and priors with a share of the widest motion prior in place of the frame's."""
    return optimum.linearized.quadratic.curvature + prediction.exchanged(share)
