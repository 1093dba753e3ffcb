"""Density, sampling and fitting of noise around what a surface looks like, the same for every kind of picture."""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.noise.base import LEVELS, LOG_SQRT_2PI, NoiseError
from calib.noise.fit import fitting


class ValueNoise(Protocol):
    """Gaussian noise of the numbers that a picture consists of, each independent of the others."""

    def deviation(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Standard deviation of values, in their shape."""
        ...


def log_density(model: ValueNoise, measured: ArrayLike, real: ArrayLike) -> NDArray[np.float64]:
    """Logarithm of the density of measuring each number when the surface looks like `real` there.

    That of a whole colour is the sum over its channels.
    """
    real = np.asarray(real, np.float64)
    deviation = _deviation(model, real)
    return -0.5 * ((np.asarray(measured) - real) / deviation) ** 2 - np.log(deviation) - LOG_SQRT_2PI


def sample(model: ValueNoise, generator: np.random.Generator, real: ArrayLike) -> NDArray[np.float64]:
    """Draws one measurement of every number; neither rounded nor cut off at black and white."""
    real = np.asarray(real, np.float64)
    return real + _deviation(model, real) * generator.standard_normal(real.shape)


def still(images: ArrayLike, full_scale: float = LEVELS - 1) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Measured and real numbers from pictures of a scene in which nothing moves, for a `fit`.

    The mean over the pictures takes the place of the real number. It lies nearer to each measurement than that, so
    measurements are moved away from it until their variance is right.

    Args:
        images: (n, …), at least two.
        full_scale: largest number of a pixel. Noise is cut off there and at 0, so what ever reached one of them does
            not count.

    Returns:
        Measured and real numbers, both (n, …); NaN where they do not count.

    Raises:
        NoiseError: there are fewer than two pictures.
    """
    pictures = np.asarray(images, np.float64)
    if len(pictures) < 2:
        raise NoiseError(
            f"noise is told from at least 2 pictures of a scene in which nothing moves, not {len(pictures)}"
        )
    whole = ((pictures > 0) & (pictures < full_scale)).all(axis=0)
    real = np.broadcast_to(np.where(whole, pictures.mean(axis=0), np.nan), pictures.shape)
    return real + (pictures - real) * np.sqrt(len(pictures) / (len(pictures) - 1)), real


def residuals(measured: ArrayLike, real: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Measured minus real numbers (n,), and the real ones, where both are known; thinned to what a fit needs.

    Raises:
        NoiseError: there is none.
    """
    values, truth = np.broadcast_arrays(np.asarray(measured, np.float64), np.asarray(real, np.float64))
    known = np.flatnonzero(np.isfinite(values) & np.isfinite(truth))
    if not known.size:
        raise NoiseError(f"none of {values.size} measured numbers comes with a real one")
    if known.size > fitting.LARGEST:
        known = np.random.default_rng(0).choice(known, fitting.LARGEST, replace=False)
    truth = truth.ravel()[known]
    return values.ravel()[known] - truth, truth


def fit_deviation(measured: ArrayLike, real: ArrayLike) -> float:
    """The one deviation of greatest likelihood, in levels of 256.

    Raises:
        NoiseError: no measured number comes with a real one.
    """
    residual, _ = residuals(measured, real)
    one = np.ones((len(residual), 1))
    return float(fitting.maximize(residual, fitting.Columns(one[:, :0], one), span=LEVELS).spread[0])


def _deviation(model: ValueNoise, values: NDArray[np.float64]) -> NDArray[np.float64]:
    return model.deviation(values.astype(np.float32)).astype(np.float64)
