"""Gain of an image: exposure and white balance that changed since the appearance was taken in."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.terms.median import median

#: Values between which a colour is neither noise nor saturated [8-bit levels].
DARKEST, BRIGHTEST = 16.0, 250.0

#: Fewer samples do not show a gain.
MIN_SAMPLES = 50

#: Gains beyond these are no exposure: the image shows something else.
MIN_GAIN, MAX_GAIN = 0.25, 4.0

#: Nor are gains of which one is so many times another a white balance: from daylight to incandescent light, red changes
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
    of_image, own = np.ascontiguousarray(measured.T), np.ascontiguousarray(expected.T)
    with np.errstate(invalid="ignore", divide="ignore"):
        usable = (np.minimum(own, of_image) > DARKEST) & (np.maximum(own, of_image) < BRIGHTEST)
        ratios = of_image / own
    known = [ratio[chosen] for ratio, chosen in zip(ratios, usable)]
    result = np.array([_gain(some) if len(some) >= MIN_SAMPLES else np.nan for some in known], np.float32)
    wanting = np.isnan(result)
    if wanting.all() or np.nanmax(result) > MAX_TINT * np.nanmin(result):
        wanting[:] = True
    if wanting.any():
        is_enough = np.count_nonzero(usable.any(axis=0)) >= MIN_SAMPLES
        result[wanting] = _gain(np.concatenate(known)) if is_enough else 1.0
    return result


def _gain(ratios: NDArray[np.floating]) -> float:
    """Median of ratios; 1 if it is no exposure."""
    ratio = median(ratios)
    return ratio if MIN_GAIN <= ratio <= MAX_GAIN else 1.0
