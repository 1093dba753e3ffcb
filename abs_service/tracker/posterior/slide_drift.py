"""Drift along slides: how far a surface may have moved along itself by now, where nothing holds it (see `slides`).

The curvature of the cost does not tell: errors of direction hold the mesh as if they were measurements, so the errors
of Θ end at some millimetres, while the object goes on. Between two frames it moves by what the widest motion prior
allows for, whose velocity v lasts for a time τ: 2 τ v² t in squares after a time t. What holds it with the information
h takes all but 1 / (1 + h σ²) of that error away. Of a shift that is held to a millimetre nothing is left; a surface
that nothing holds is known to 13 cm after a second.

An outline holds a surface if it is its end. Of a sheet that rolls up it is a silhouette, which single images may show
to be an end, at the place to which it has drawn the mesh. So after a long drift it has to be one in some in a row.
"""

from collections import deque
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.posterior.covariance.slides import Slides
from abs_service.tracker.posterior.priors.motion_prediction import MotionPrediction

#: Smaller variances are not added: a tenth of a millimetre [m²].
MIN_VARIANCE = 1e-8

#: A slide is no longer than the object: larger variances are those of a surface that is anywhere, in squares of `size`.
_MAX_VARIANCE = 4.0

#: A surface that may have drifted farther than this [m], as within a third of a second, is held by an outline again if
#: that is the object's end in so many images in a row.
LONG_DRIFT_M, IN_A_ROW = 0.045, 8


class Drift(NamedTuple):
    """Drift in one frame.

    Attributes:
        covariance: of the vertices (n, 3, 3) by drift [m²], or (1, 1, 1) without any.
        slides: those of the estimate, without what an outline holds for the moment after a long drift.
    """

    covariance: NDArray[np.float64]
    slides: Slides


class SlideDrift:
    """Variance of six motions of the surface, those that are held least first, over time.

    They are told apart by how well they are held: the surface turns, and so do the motions along it.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Restarts without drift, after a relocation, which has an error of its own."""
        self._variance = np.zeros(6)
        self._by_outline = deque[NDArray[np.float64]](maxlen=IN_A_ROW)

    def update(self, slides: Slides, prediction: MotionPrediction) -> Drift:
        """The drift up to a frame.

        Args:
            slides: those of the estimate of the frame.
            prediction: its motion prior. The first frame defines where the surface is.
        """
        if not len(slides.held):
            return Drift(np.zeros((1, 1, 1)), slides)
        slides = self._without_momentary(slides)
        return Drift(self._covariance(slides, prediction), slides)

    def _without_momentary(self, slides: Slides) -> Slides:
        """The slides without what an outline holds for the moment, after a long drift."""
        order = np.argsort(slides.held)
        self._by_outline.append(slides.by_outline[order])
        momentary = np.zeros(6)
        momentary[order] = slides.by_outline[order] - np.min(self._by_outline, axis=0)
        momentary[order] *= self._variance > LONG_DRIFT_M**2
        return replace(slides, held=slides.held - momentary)

    def _covariance(self, slides: Slides, prediction: MotionPrediction) -> NDArray[np.float64]:
        """Covariance of the vertices (n, 3, 3), see `Drift`."""
        if prediction.is_first:
            return np.zeros((1, 1, 1))
        order = np.argsort(slides.held)
        moved = self._variance + prediction.wandered_m2
        self._variance = np.minimum(moved / (1 + slides.held[order] * moved) ** 2, _MAX_VARIANCE * slides.size**2)
        large = self._variance > MIN_VARIANCE
        if not large.any():
            return np.zeros((1, 1, 1))
        drift = slides.displacements(order[large]) * np.sqrt(self._variance[large])
        return np.asarray(drift @ drift.transpose(0, 2, 1), np.float64)
