"""Image noise due to the uncertain position of the appearance on the mesh."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Widening(NamedTuple):
    """Factor by which texture registration noise widens the sensor's standard deviation.

    Attributes:
        factor: of the standard deviation (m or 1, channels); a single row applies to all samples.
        log: its logarithm.
    """

    factor: NDArray[np.float32]
    log: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class TextureRegistrationNoise:
    """Texture registration noise: the position of each sample's appearance is known to a fraction of a pixel only.

    The appearance was sampled in the first images on the first mesh, and the model follows the surface only
    approximately. This is harmless on uniform areas; at a sharp edge a tenth of a pixel is many levels. To first order,
    the variance of a sample is σ² of the sensor plus the square of `px` times the gradient of the appearance.

    Attributes:
        px: standard deviation of the position, in pixels of the sensor.
    """

    px: float

    def widening(self, gradients: NDArray[np.float32], deviation: NDArray[np.floating]) -> Widening:
        """Widening of the sensor's own noise at the predicted surface.

        Args:
            gradients: of the appearance at the samples (m, channels, 2) [1/px]; NaN where unknown.
            deviation: the sensor's own standard deviation of every sample, broadcastable to (m, channels).
        """
        if self.px == 0 or np.isnan(gradients).all():  # the samples of a dense view differ from candidate to candidate
            return NO_WIDENING
        square = np.nan_to_num(np.einsum("nci,nci->nc", gradients, gradients))
        variance = 1 + square * np.float32(self.px**2) / np.square(deviation, dtype=np.float32)
        return Widening(np.sqrt(variance), np.float32(0.5) * np.log(variance))


#: That of a mesh on which everything is where it belongs.
NO_WIDENING = Widening(np.ones((1, 1), np.float32), np.zeros((1, 1), np.float32))
NO_REGISTRATION_NOISE = TextureRegistrationNoise(0.0)
