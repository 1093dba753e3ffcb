"""Antialiasing: pixels at the rim of a body are the mean over many rays."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

#: Rays per pixel and axis.
_SUBRAYS = 4

Cast = Callable[[NDArray[np.float64]], NDArray[np.float32]]


def cast_antialiased(cast: Cast, rays: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Casts a ray through each pixel centre, and supersamples pixels that the body's rim crosses.

    Directions between pixels are interpolated from the neighbours', accurate to second order in the pixel size.

    Args:
        cast: maps unit directions (height, width, 3) to results (channels, height, width), NaN for a miss.
        rays: unit directions of neighbouring pixels, (height, width, 3).

    Returns:
        Results (channels, height, width), and the body's coverage of each pixel (height, width).
    """
    sight = cast(rays)
    hit = ~np.isnan(sight[0])
    share = hit.astype(np.float32)
    if min(hit.shape) < 3:
        return sight, share
    rim = maximum_filter(share, 3) > minimum_filter(share, 3)
    rim[[0, -1]] = rim[:, [0, -1]] = False
    rows, columns = np.nonzero(rim)
    right = (rays[rows, columns + 1] - rays[rows, columns - 1]) / 2
    down = (rays[rows + 1, columns] - rays[rows - 1, columns]) / 2
    offsets = (np.arange(_SUBRAYS) - 0.5 * (_SUBRAYS - 1)) / _SUBRAYS
    v, u = (part.reshape(-1, 1) for part in np.meshgrid(offsets, offsets, indexing="ij"))
    between = rays[rows, columns][:, None] + u * right[:, None] + v * down[:, None]
    fine = cast(np.ascontiguousarray(between / np.linalg.norm(between, axis=-1, keepdims=True)))
    hits = np.count_nonzero(~np.isnan(fine[0]), axis=-1)
    with np.errstate(invalid="ignore"):
        mean = np.nansum(fine, axis=-1) / np.where(hits > 0, hits, np.nan)
    sight[:, rows, columns] = np.where(hits < _SUBRAYS**2, mean, sight[:, rows, columns])
    share[rows, columns] = hits / _SUBRAYS**2
    return sight, share
