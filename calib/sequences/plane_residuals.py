"""Consistency of a sensor's reported per-pixel deviations with residuals from local planes."""

import numpy as np
from numpy.typing import NDArray

#: Half width of the window for plane fits; minimum number of returns in it.
_REACH, _MIN_KNOWN = 2, 20

#: Largest relative range of distances in a window that is treated as a plane.
_RIM = 0.03


def normalized(
    distance: NDArray[np.floating], reported_sigma: NDArray[np.floating], rays: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Residuals of one image from local planes over reported deviations (height, width); NaN without a plane.

    The plane is fitted to the 25 pixels around each one, including itself; its own influence is corrected by the
    leverage. On a curved surface the residuals are too large, never too small.

    Args:
        distance: radial (height, width) [m]; NaN without return.
        reported_sigma: reported deviation (height, width) [m].
        rays: unit directions (height, width, 3).
    """
    side = 2 * _REACH + 1
    inverse, along = (_windows(part, side) for part in (1 / distance, rays))  # (h, w, 25), (h, w, 3, 25)
    near = _windows(distance, side)
    known = np.isfinite(near)
    middle = near[..., side * side // 2]
    with np.errstate(invalid="ignore"):
        known &= np.abs(near - middle[..., None]) < _RIM * middle[..., None]
        flat = (known.sum(axis=-1) >= _MIN_KNOWN) & np.isfinite(middle)
    weight, columns = known[flat].astype(np.float64), along[flat]
    normal = np.einsum("nik,njk,nk->nij", columns, columns, weight)
    right = np.einsum("nik,nk,nk->ni", columns, np.where(known, inverse, 0)[flat], weight)
    covariance = np.linalg.inv(normal)
    q = np.einsum("nij,nj->ni", covariance, right)
    own = rays[_REACH:-_REACH, _REACH:-_REACH][flat]
    leverage = np.einsum("ni,nij,nj->n", own, covariance, own)
    residual = middle[flat] - 1 / np.einsum("ni,ni->n", own, q)
    z = np.full(distance.shape, np.nan)
    inner = z[_REACH:-_REACH, _REACH:-_REACH]
    sigma = reported_sigma[_REACH:-_REACH, _REACH:-_REACH][flat] * np.sqrt(np.clip(1 - leverage, 1e-3, 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        inner[flat] = np.where(sigma > 0, residual / sigma, np.nan)
    return z


def _windows(image: NDArray[np.floating], side: int) -> NDArray[np.floating]:
    """Windows (height − side + 1, width − side + 1, …, side²) of an image (height, width, …)."""
    view = np.lib.stride_tricks.sliding_window_view(image, (side, side), axis=(0, 1))
    return view.reshape(*view.shape[:-2], side * side)
