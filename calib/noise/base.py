"""What a noise model is, and the texture into which every depth noise model is rendered (eqs. 17–19)."""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: Texels describe the density for |measured − mean offset − synthesised| up to this [m]; beyond, they keep their edge
#: value.
WINDOW_M = 0.05

LOG_SQRT_2PI = 0.5 * np.log(2 * np.pi)

#: Rows and columns of the pixels that measured.
Pixels = tuple[NDArray[np.integer], NDArray[np.integer]]


class NoiseError(ValueError):
    """Parameters that describe no noise model; names the key and what is allowed."""


class DepthNoise(Protocol):
    """Gaussian noise of a distance measured by pixel p, given the real distance x [m] and the measured amplitude a."""

    @property
    def uses_amplitude(self) -> bool:
        """Whether μ or σ depends on the amplitude, so that a frame without one cannot be judged."""
        ...

    def mean(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Mean offset μ_p(x, a) of a measurement from the real distance [m]."""
        ...

    def deviation(self, x: NDArray[np.float64], a: NDArray[np.float64], p: Pixels) -> NDArray[np.float64]:
        """Standard deviation σ_p(x, a) of a measurement [m], always positive."""
        ...


def log_density(model: DepthNoise, measured: ArrayLike, x: ArrayLike, a: ArrayLike, p: Pixels) -> NDArray[np.float64]:
    """Logarithm of eq. 18: density of measuring `measured` [m] at pixel p when the real distance is `x` [m]."""
    x, a = np.asarray(x, np.float64), np.asarray(a, np.float64)
    deviation = model.deviation(x, a, p)
    normalized = (np.asarray(measured) - x - model.mean(x, a, p)) / deviation
    return -0.5 * normalized**2 - np.log(deviation) - LOG_SQRT_2PI


def sample(
    model: DepthNoise, generator: np.random.Generator, x: ArrayLike, a: ArrayLike, p: Pixels
) -> NDArray[np.float64]:
    """Draws one measurement [m] for every real distance `x` [m] and amplitude `a` at the pixels `p`."""
    x, a = np.asarray(x, np.float64), np.asarray(a, np.float64)
    return x + model.mean(x, a, p) + model.deviation(x, a, p) * generator.standard_normal(x.shape)


def without_offset(
    model: DepthNoise, distance: NDArray[np.floating], amplitude: NDArray[np.floating]
) -> NDArray[np.float32]:
    """A depth image (height, width) [m] without the mean offset that each distance has if it is right."""
    x, a = distance.astype(np.float64), amplitude.astype(np.float64)
    pixels = np.indices(distance.shape)
    return (x - model.mean(x, a, (pixels[0], pixels[1]))).astype(np.float32)


def render_texture(
    model: DepthNoise, distance: NDArray[np.float32], amplitude: NDArray[np.float32], uniform: float
) -> NDArray[np.float32]:
    """Renders eq. 18 for one frame into the coefficients that the likelihood kernel reads.

    Every noise model becomes the same texture, so all of them run at the same speed. With y the measurement without
    the mean offset that it has if it is right, and t = y − x, a texel holds [y, m0, m1, s0, s1, s2, n0, n1]: mean
    offset beyond that one m0 + m1 t, inverse deviation s0 + s1 t + s2 t², and the negative logarithm of the normaliser
    n0 + n1 t. A pixel without a return, and the border of one pixel that stands for everything outside the image, hold
    the uniform density instead.

    Args:
        model: the noise model.
        distance: measured radial distances (height, width) [m], NaN without return.
        amplitude: measured amplitudes (height, width); ignored where the model does not depend on them.
        uniform: negative log-density of a measurement that says nothing about the surface.

    Returns:
        Coefficients (height + 2, width + 2, 8).
    """
    height, width = distance.shape
    texture = np.zeros((height + 2, width + 2, 8), np.float32)
    texture[..., 6] = uniform
    valid = np.isfinite(distance) & (distance > 0)  # some devices report infinity for what is out of range
    if model.uses_amplitude:
        valid &= np.isfinite(amplitude)
    rows, columns = np.nonzero(valid)
    p = (rows, columns)
    measured, a = distance[p].astype(np.float64), amplitude[p].astype(np.float64)
    offset = model.mean(measured, a, p)  # may be larger than the window, which has to lie where the surface is
    center = measured - offset
    nodes = [np.maximum(center - t, 1e-3) for t in (-WINDOW_M, 0.0, WINDOW_M)]
    deviation = [model.deviation(x, a, p) for x in nodes]
    texels = np.empty((measured.size, 8), np.float32)
    texels[:, 0] = center
    texels[:, 1], texels[:, 2], _ = _parabola(*(model.mean(x, a, p) - offset for x in nodes))
    texels[:, 3], texels[:, 4], texels[:, 5] = _parabola(*(1 / sigma for sigma in deviation))
    texels[:, 6], texels[:, 7], _ = _parabola(*(np.log(sigma) + LOG_SQRT_2PI for sigma in deviation))
    texture[rows + 1, columns + 1] = texels
    return texture


def _parabola(
    below: NDArray[np.float64], middle: NDArray[np.float64], above: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Coefficients (value, slope, curvature) in t of the parabola through the values at t = −WINDOW_M, 0, WINDOW_M."""
    return middle, (above - below) / (2 * WINDOW_M), (above - 2 * middle + below) / (2 * WINDOW_M**2)
