"""Random error of distances from single images: how far they scatter about what small patches of things nearly are."""

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

#: Side of a patch that is nearly a plane [px], and of one that is nearly a paraboloid, which shows errors that
#: neighbours share: those of stereo cameras, which match windows, are alike over some ten pixels.
SMALL_PX, LARGE_PX = 9, 33

#: Percentiles of the patches: most of an image may be curved, rough or at an edge, but hardly three quarters of it,
#: or nine tenths.
FLAT_PERCENT, SMOOTH_PERCENT = 25, 10

#: Largest ratio of the larger patches to the small ones that counts; more is relief. Ratio in real images: stereo 2.5,
#: structured light 1.1 to 1.7, time of flight 1.2.
MAX_SHARED = 3.0

#: Fewer patches say nothing.
MIN_PATCHES = 40


def scatter(distance: NDArray[np.floating]) -> float:
    """Deviation of the inverse distances [1/m] from smooth surfaces, where an image is flat; NaN if too little is seen.

    Inverse distances of a plane are linear in the pixels. What neighbouring pixels share of their errors is seen in
    part: the value is rather too small than too large.

    Args:
        distance: distances (height, width) [m], NaN without return.
    """
    row, column = np.mgrid[:LARGE_PX, :LARGE_PX] / LARGE_PX
    plane, bent = (np.ones_like(row), row, column), (row**2, row * column, column**2)
    alone = _scatter(distance, SMALL_PX, [part[:SMALL_PX, :SMALL_PX] for part in plane], SMALL_PX, FLAT_PERCENT)
    shared = _scatter(distance, LARGE_PX, [*plane, *bent], LARGE_PX // 2, SMOOTH_PERCENT)
    return alone if np.isnan(shared) else max(alone, min(shared, MAX_SHARED * alone))


def _scatter(
    distance: NDArray[np.floating],
    side: int,
    shapes: Sequence[NDArray[np.float64]],
    stride: int,
    percent: float,
) -> float:
    """A percentile, over the patches, of the deviation from the best combination of shapes (side, side) [1/m]."""
    if min(distance.shape) < side:
        return float("nan")
    patches = sliding_window_view(distance, (side, side))[::stride, ::stride].reshape(-1, side**2)
    patches = 1 / patches[np.isfinite(patches).all(axis=1) & (patches > 0).all(axis=1)].astype(np.float64)
    if len(patches) < MIN_PATCHES:
        return float("nan")
    basis = np.linalg.qr(np.stack([shape.ravel() for shape in shapes], axis=1))[0]
    rest = patches - (patches @ basis) @ basis.T
    deviations = np.sqrt(np.sum(rest**2, axis=1) / (side**2 - len(shapes)))
    return float(np.percentile(deviations, percent))
