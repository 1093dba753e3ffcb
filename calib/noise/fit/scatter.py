"""Random error of distances from single images: how far they scatter about the planes that small patches are nearly."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

#: Side of a patch [px]: over so few, things are nearly flat, and neighbouring errors are not all of one sign.
PATCH_PX = 9

#: Percentile of the patches: most of an image may be curved, rough or at an edge, but hardly three quarters of it.
FLAT_PERCENT = 25

#: Fewer patches say nothing.
MIN_PATCHES = 40


def scatter(distance: NDArray[np.floating]) -> float:
    """Deviation of the inverse distances [1/m] from planes, where an image is flat; NaN if too little is seen.

    Inverse distances of a plane are linear in the pixels. What neighbouring pixels share of their errors is not seen:
    the value is rather too small than too large.

    Args:
        distance: distances (height, width) [m], NaN without return.
    """
    if min(distance.shape) < PATCH_PX:
        return float("nan")
    patches = sliding_window_view(distance, (PATCH_PX, PATCH_PX))[::PATCH_PX, ::PATCH_PX].reshape(-1, PATCH_PX**2)
    patches = 1 / patches[np.isfinite(patches).all(axis=1) & (patches > 0).all(axis=1)].astype(np.float64)
    if len(patches) < MIN_PATCHES:
        return float("nan")
    row, column = np.mgrid[:PATCH_PX, :PATCH_PX].reshape(2, -1)
    plane = np.linalg.qr(np.stack([np.ones(PATCH_PX**2), row, column], axis=1))[0]
    rest = patches - (patches @ plane) @ plane.T
    deviations = np.sqrt(np.sum(rest**2, axis=1) / (PATCH_PX**2 - 3))
    return float(np.percentile(deviations, FLAT_PERCENT))
