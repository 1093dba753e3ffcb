"""What not knowing where exactly on the mesh its appearance lies makes of a picture's noise."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.base import View


class Widening(NamedTuple):
    """How much more than the sensor's noise a picture deviates from what the surface looks like.

    Attributes:
        factor: of the standard deviation (m or 1, channels); one row stands for all samples.
        log: its logarithm.
    """

    factor: NDArray[np.float32]
    log: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Misplacement:
    """The appearance of every sample is known, but only to a part of a pixel where it belongs.

    It was read from the first images through the first mesh, and since then the model has bent the mesh as well as it
    can. Where a print is even that does no harm; at a sharp edge a tenth of a pixel is many levels. So the variance of
    a sample is the sensor's σ² and the square of `px` times the slope of the appearance there, to first order.

    Attributes:
        px: standard deviation of the place, in pixels of the sensor that looks.
    """

    px: float

    def widening(self, view: View, predicted: Surface, deviation: NDArray[np.floating]) -> Widening:
        """What it makes of the sensor's own noise, where the surface is expected.

        Args:
            view: the sensor's, after it has looked.
            predicted: the predicted mesh, a population of one.
            deviation: the sensor's own standard deviation of every sample, broadcastable to (m, channels).
        """
        slopes = view.slopes(predicted)
        if self.px == 0 or np.isnan(slopes).all():  # the samples of a dense view differ from candidate to candidate
            return NO_WIDENING
        square = np.nan_to_num(np.einsum("nci,nci->nc", slopes, slopes))
        variance = 1 + square * np.float32(self.px**2) / np.square(deviation, dtype=np.float32)
        return Widening(np.sqrt(variance), np.float32(0.5) * np.log(variance))


#: That of a mesh on which everything is where it belongs.
NO_WIDENING = Widening(np.ones((1, 1), np.float32), np.zeros((1, 1), np.float32))
NOT_AT_ALL = Misplacement(0.0)
