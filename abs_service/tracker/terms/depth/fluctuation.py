"""Fluctuation of a sensor's distances from frame to frame, beyond its noise model.

Stereo cameras err by the same for tens of neighbouring pixels, and otherwise in the next image: a single image shows no
more than a surface that is a little bent. What the distances are off the mesh changes from one frame to the next by
noise. What the model cannot follow, and a mesh that has slid, are off in both frames by nearly the same.
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.terms.image_noise import NORMAL_MEDIAN
from abs_service.tracker.terms.median import median

#: Weight of a new frame in the running mean square; until there are as many frames, all count the same. Fewer than
#: `MIN_FRAMES` say nothing.
NEW, MIN_FRAMES = 0.1, 5

#: Fluctuation that contradicts the noise model, in its deviations, as in the first image (`TOO_MUCH_SCATTER`). With a
#: right one, wrinkles that wander through a curtain of 2 mm of noise make 1.3 of them at most, and real structured
#: light 0.1 to 0.8, as it repeats its steps.
TOO_MUCH = 1.5

#: Fewer vertices that are measured in both frames say nothing.
MIN_VERTICES = 30


class Fluctuation:
    """Fluctuation of one sensor's distances over time.

    Attributes:
        scale: of the deviations of the noise model in the next frame, at least 1.
    """

    def __init__(self) -> None:
        self.scale = 1.0
        self._before, self._square, self._frames = np.zeros((2, 0)), 0.0, 0

    def update(self, distance: NDArray[np.float64], deviation: NDArray[np.float64]) -> None:
        """Takes another frame in; one with too little in sight changes nothing.

        Args:
            distance: of the vertices from their measurements, signed (n,) [m].
            deviation: of these by the noise model (n,) [m], 0 where nothing is measured.
        """
        before, self._before = self._before, np.stack([distance, deviation])
        if before.shape != self._before.shape:
            return
        both = (before[1] > 0) & (deviation > 0)
        if np.count_nonzero(both) < MIN_VERTICES:
            return
        change = np.abs(distance - before[0])[both] / np.hypot(deviation, before[1])[both]
        self._frames += 1
        self._square += max(NEW, 1 / self._frames) * ((median(change) / NORMAL_MEDIAN) ** 2 - self._square)
        scale = float(np.sqrt(self._square))
        self.scale = scale if self._frames >= MIN_FRAMES and scale > TOO_MUCH else 1.0
