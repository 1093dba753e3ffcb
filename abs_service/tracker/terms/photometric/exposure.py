"""Gain of a colour image: exposure and white balance that changed since the appearance was taken in."""

import numpy as np
from numpy.typing import NDArray

#: Values between which a colour is neither noise nor saturated [8-bit levels].
DARKEST, BRIGHTEST = 16.0, 250.0

#: Fewer samples of a channel do not show its gain.
MIN_SAMPLES = 50

#: Gains beyond these are no exposure: the image shows something else.
LEAST, MOST = 0.25, 4.0


def gains(measured: NDArray[np.floating], expected: NDArray[np.floating]) -> NDArray[np.float32]:
    """Gain of every channel (channels,): median ratio of measured and expected values; 1 where too few are known.

    The median is not moved by an occluder on less than half of the surface, nor, in textured surfaces, by a prediction
    that is off: brighter and darker places are exchanged.

    Args:
        measured: values at the predicted samples (m, channels) [8-bit levels]; NaN where unknown.
        expected: appearance of these samples (m, channels) [8-bit levels]; NaN where unknown.
    """
    result = np.ones(expected.shape[1], np.float32)
    with np.errstate(invalid="ignore"):
        usable = (np.minimum(expected, measured) > DARKEST) & (np.maximum(expected, measured) < BRIGHTEST)
    for channel, chosen in enumerate(usable.T):
        if np.count_nonzero(chosen) >= MIN_SAMPLES:
            ratio = np.median(measured[chosen, channel] / expected[chosen, channel])
            result[channel] = ratio if LEAST <= ratio <= MOST else 1
    return result
