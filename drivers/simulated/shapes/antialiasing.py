"""Pixels at the rim of a body: what they see is the mean of many lines of sight."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

#: Lines of sight per pixel and axis.
_SUBRAYS = 4

Cast = Callable[[NDArray[np.float64]], NDArray[np.float32]]


def cast_antialiased(cast: Cast, rays: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """What pixels see of a body: through their centres, and where the rim crosses a pixel the mean of all it sees.

    Directions between pixels are interpolated from the neighbours', which is exact to second order in a pixel's size.

    Args:
        cast: maps unit directions (height, width, 3) to what they see, (channels, height, width), NaN for a miss.
        rays: unit directions of neighbouring pixels, (height, width, 3).

    Returns:
        What the pixels see, (channels, height, width), and the part of each that the body fills, (height, width).
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
