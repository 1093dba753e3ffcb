"""Colours that two surfaces have in common, whatever the exposure."""

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

#: Bins of brightness, in doublings, and of the shares of the first two channels in it.
_BRIGHTNESS, _SHARES = np.linspace(-8, 8, 65), np.linspace(0, 1, 33)

#: Largest brightness beside the median, and largest gain of an exposure, as `terms.photometric.exposure` has it, in
#: doublings and in bins.
_EXTREME, _GAIN = 6.0, 8

#: What is added to every channel, as a share of the median brightness: dark colours are mostly noise.
_GREY = 1 / 8


def common_share(found: NDArray[np.floating], lost: NDArray[np.floating]) -> float:
    """Share of the colours of both surfaces that is in the other one as well; 1 if nothing is known of one of them.

    That is the intersection of their histograms (Swain and Ballard, 1991), at the exposure at which it is largest, over
    that of two halves of the same surface, every other value: few values of a colourful print fill different bins by
    chance. A part that is 1/k of a surface shares at least 1/k.

    Args:
        found, lost: values (n, channels) of one sensor on each of them; NaN where unknown.
    """
    values = [known for one in (found, lost) if len(known := one[np.isfinite(one).all(axis=1)]) > 1]
    if len(values) < 2:
        return 1.0
    light = max(float(np.median(values[1].mean(axis=1))), 1e-9)
    alike = min(_overlap(one[::2], one[1::2], light) for one in values)
    return min(_overlap(values[0], values[1], light) / alike, 1.0)


def _overlap(one: NDArray[np.floating], other: NDArray[np.floating], light: float) -> float:
    first, second = _histogram(one, light), _histogram(other, light)
    return max(float(np.minimum(np.roll(first, bins, axis=0), second).sum()) for bins in range(-_GAIN, _GAIN + 1))


def _histogram(values: NDArray[np.floating], light: float) -> NDArray[np.float64]:
    """Shares of values (n, channels) by brightness over `light` and, if there are several channels, by colour."""
    brightness = values.mean(axis=1)
    axes = [np.log2(np.maximum(brightness / light, 2**-_EXTREME)).clip(-_EXTREME, _EXTREME)]
    if values.shape[1] > 1:
        greyed = values + np.maximum(_GREY * np.median(brightness), 1e-9)
        axes += list((greyed / greyed.sum(axis=1, keepdims=True)).T[:2])
    counts = np.histogramdd(np.stack(axes, axis=1), [_BRIGHTNESS, _SHARES, _SHARES][: len(axes)])[0]
    return scipy.ndimage.gaussian_filter(counts, 1.0, mode="constant") / len(values)
