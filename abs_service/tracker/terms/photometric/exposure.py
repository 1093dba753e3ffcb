"""Gain of an image: exposure and white balance that changed since the appearance was taken in."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.terms.median import median

#: Values between which a colour is neither noise nor saturated [8-bit levels].
DARKEST, BRIGHTEST = 16.0, 250.0

#: Fewer samples do not show a gain.
MIN_SAMPLES = 50

#: Gains beyond these are no exposure: the image shows something else.
LEAST, MOST = 0.25, 4.0


def gains(measured: NDArray[np.floating], expected: NDArray[np.floating]) -> NDArray[np.float32]:
    """Gain of every channel (channels,): median ratio of measured and expected values.

    A channel of which too few samples are known has that of all channels together, since exposure is common to them; 1
    if these are too few as well.

    The median is not moved by an occluder on less than half of the surface, nor, in textured surfaces, by a prediction
    that is off: brighter and darker places are exchanged.

    Args:
        measured: values at the predicted samples (m, channels) [8-bit levels]; NaN where unknown.
        expected: appearance of these samples (m, channels) [8-bit levels]; NaN where unknown.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        usable = (np.minimum(expected, measured) > DARKEST) & (np.maximum(expected, measured) < BRIGHTEST)
        ratios = measured / expected
    common = _gain(ratios[usable]) if np.count_nonzero(usable.any(axis=1)) >= MIN_SAMPLES else 1.0
    result = np.full(expected.shape[1], common, np.float32)
    for channel, chosen in enumerate(usable.T):
        if np.count_nonzero(chosen) >= MIN_SAMPLES:
            result[channel] = _gain(ratios[chosen, channel])
    return result


def _gain(ratios: NDArray[np.floating]) -> float:
    """Median of ratios; 1 if it is no exposure."""
    ratio = median(ratios)
    return ratio if LEAST <= ratio <= MOST else 1.0
