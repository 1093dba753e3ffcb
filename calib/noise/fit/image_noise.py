"""Fitting of the noise of colour, grey and intensity images."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.noise.base import LEVELS, NoiseError
from calib.noise.fit import fitting


def from_static_scene(
    images: ArrayLike, full_scale: float = LEVELS - 1
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Measured and true values (n, …) from images of a static scene, as input of a `fit`; NaN where excluded.

    The mean over the images replaces the true value. Residuals from the mean are too small by the factor √((n − 1) /
    n); they are scaled to the unbiased variance.

    Args:
        images: (n, …), at least two.
        full_scale: largest value of a pixel. Pixels that reach it or 0 in any image are excluded, because their noise
            is clipped.

    Raises:
        NoiseError: fewer than two images.
    """
    pictures = np.asarray(images, np.float64)
    if len(pictures) < 2:
        raise NoiseError(f"noise is estimated from at least 2 pictures of a static scene, not {len(pictures)}")
    whole = ((pictures > 0) & (pictures < full_scale)).all(axis=0)
    real = np.broadcast_to(np.where(whole, pictures.mean(axis=0), np.nan), pictures.shape)
    return real + (pictures - real) * np.sqrt(len(pictures) / (len(pictures) - 1)), real


def residuals(measured: ArrayLike, real: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Residuals (n,) and true values where both are finite; subsampled to at most `fitting.MAX_SAMPLES`.

    Raises:
        NoiseError: there are none.
    """
    values, truth = np.broadcast_arrays(np.asarray(measured, np.float64), np.asarray(real, np.float64))
    known = np.flatnonzero(np.isfinite(values) & np.isfinite(truth))
    if not known.size:
        raise NoiseError(f"none of {values.size} measured numbers comes with a real one")
    if known.size > fitting.MAX_SAMPLES:
        known = np.random.default_rng(0).choice(known, fitting.MAX_SAMPLES, replace=False)
    truth = truth.ravel()[known]
    return values.ravel()[known] - truth, truth


def fit_deviation(measured: ArrayLike, real: ArrayLike) -> float:
    """Maximum-likelihood deviation, in levels of 256.

    Raises:
        NoiseError: no measured value has a finite true value.
    """
    residual, _ = residuals(measured, real)
    one = np.ones((len(residual), 1))
    return float(fitting.maximize_likelihood(residual, fitting.Design(one[:, :0], one), span=LEVELS).spread[0])
