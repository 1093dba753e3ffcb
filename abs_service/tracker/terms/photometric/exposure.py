"""Gain of an image: exposure and white balance that changed since the appearance was taken in."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.terms.median import median
from calib.jit import kernel

#: Values between which a colour is neither noise nor saturated [8-bit levels].
DARKEST, BRIGHTEST = 16.0, 250.0

#: Fewer samples do not show a gain.
MIN_SAMPLES = 50

#: Gains beyond these are no exposure: the image shows something else.
MIN_GAIN, MAX_GAIN = 0.25, 4.0

#: Largest ratio of two gains of a white balance: from daylight to incandescent light, red changes
#: three times as much as blue, 1.7 times in values with a gamma of 2.2. Things of one colour would look alike.
MAX_TINT = 2.0


def gains(measured: NDArray[np.floating], expected: NDArray[np.floating]) -> NDArray[np.float32]:
    """Gain of every channel (channels,): median ratio of measured and expected values.

    A channel of which too few samples are known has that of all channels together, since exposure is common to them; 1
    if these are too few as well. So have all channels if theirs differ by more than a white balance does.

    The median is not moved by an occluder on less than half of the surface, nor, in textured surfaces, by a prediction
    that is off: brighter and darker places are exchanged.

    Args:
        measured: values at the predicted samples (m, channels) [8-bit levels]; NaN where unknown.
        expected: appearance of these samples (m, channels) [8-bit levels]; NaN where unknown.
    """
    channels, samples = expected.shape[1], len(expected)
    ratios, count = np.empty((channels, samples), np.result_type(measured, expected)), np.zeros(channels + 1, np.int64)
    find_ratios(np.ascontiguousarray(measured), np.ascontiguousarray(expected), ratios, count)
    known = [ratio[:number] for ratio, number in zip(ratios, count.tolist())]
    result = [_gain(some) if len(some) >= MIN_SAMPLES else None for some in known]
    own = [gain for gain in result if gain is not None]
    is_exposure = bool(own) and max(own) <= MAX_TINT * min(own)
    if is_exposure and len(own) == channels:
        return np.array(result, np.float32)
    shared = _gain(np.concatenate(known)) if count[channels] >= MIN_SAMPLES else 1.0
    return np.array([gain if gain is not None and is_exposure else shared for gain in result], np.float32)


@kernel
def find_ratios(
    measured: NDArray[np.floating],
    expected: NDArray[np.floating],
    ratios: NDArray[np.floating],
    count: NDArray[np.int64],
) -> None:
    """Ratios of values (m, channels) that are neither noise nor saturated, of every channel (channels, m).

    Adds their numbers to zeros, and that of the samples with any (channels + 1,).
    """
    for v in range(measured.shape[0]):
        any_usable = 0
        for c in range(measured.shape[1]):
            value, own = measured[v, c], expected[v, c]
            if value > DARKEST and own > DARKEST and value < BRIGHTEST and own < BRIGHTEST:  # False for NaN
                ratios[c, count[c]] = value / own
                count[c] += 1
                any_usable = 1
        count[measured.shape[1]] += any_usable


def _gain(ratios: NDArray[np.floating]) -> float:
    """Median of ratios; 1 if it is no exposure."""
    ratio = median(ratios)
    return ratio if MIN_GAIN <= ratio <= MAX_GAIN else 1.0
