"""Drift along slides: how far a surface may have moved along itself by now, where nothing holds it (see `slides`).

The curvature of the cost does not tell: errors of direction hold the mesh as if they were measurements, so the errors
of Θ end at some millimetres, while the object goes on. Between two frames it moves by what the widest motion prior
allows for, whose velocity v lasts for a time τ: 2 τ v² t in squares after a time t. What holds it with the information
h takes all but 1 / (1 + h σ²) of that error away. Of a shift that is held to a millimetre nothing is left; a surface
that nothing holds is known to 13 cm after a second.
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.posterior.covariance.slides import Slides
from abs_service.tracker.posterior.priors.motion_prediction import MotionPrediction

#: Smaller variances are not added: a tenth of a millimetre [m²].
MIN_VARIANCE = 1e-8

#: A slide is no longer than the object: larger variances are those of a surface that is anywhere, in squares of `size`.
_MAX_VARIANCE = 4.0


class SlideDrift:
    """Variance of six motions of the surface, those that are held least first, over time.

    They are told apart by how well they are held: the surface turns, and so do the motions along it.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Restarts without drift, after a relocation, which has an error of its own."""
        self._variance = np.zeros(6)

    def update(self, slides: Slides, prediction: MotionPrediction) -> NDArray[np.float64]:
        """Covariance of the vertices (n, 3, 3) by drift [m²], or (1, 1, 1) without any.

        Args:
            slides: those of the estimate of a frame.
            prediction: its motion prior. The first frame defines where the surface is.
        """
        if prediction.is_first or not len(slides.held):
            return np.zeros((1, 1, 1))
        order = np.argsort(slides.held)
        moved = self._variance + prediction.wandered_m2
        self._variance = np.minimum(moved / (1 + slides.held[order] * moved) ** 2, _MAX_VARIANCE * slides.size**2)
        large = self._variance > MIN_VARIANCE
        if not large.any():
            return np.zeros((1, 1, 1))
        drift = slides.displacements(order[large]) * np.sqrt(self._variance[large])
        return np.asarray(drift @ drift.transpose(0, 2, 1), np.float64)
