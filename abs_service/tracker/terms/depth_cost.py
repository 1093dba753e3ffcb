"""What samples cost whose distance was measured; textures are as `calib.noise.base.write_texture` makes them."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.synthesis import sampling
from calib.jit import kernel, prange
from calib.noise.base import WINDOW_M

#: A vertex in free space costs one unit of log-likelihood more for every so many metres from the object: the outline
#: errs by a Laplace distribution of this scale.
FREE_SCALE_M = 0.01


@kernel
def write_constants(
    silent: NDArray[np.bool_],
    free_m: NDArray[np.float32],
    agreeing: float,
    outlier: float,
    top: int,
    left: int,
    texture: NDArray[np.float32],
) -> None:
    """Texels that cost `agreeing` where a pixel is silent, and outlier + d / s where it is d > 0 into free space."""
    per_metre = np.float32(1 / FREE_SCALE_M)
    for row in range(silent.shape[0]):
        for column in range(silent.shape[1]):
            free = free_m[row, column]
            if free > 0 or silent[row, column]:
                texel = texture[top + row + 1, left + column + 1]
                texel[:] = 0
                texel[6] = np.float32(outlier) + free * per_metre if free > 0 else np.float32(agreeing)


@kernel
def normalize(
    pixel: NDArray[np.int32],
    distance: NDArray[np.float32],
    texture: NDArray[np.float32],
    residual: NDArray[np.float64],
    inverse: NDArray[np.float64],
    measured: NDArray[np.bool_],
) -> None:
    """Residuals of samples (n,) in their deviations, these deviations' inverses, and whether anything was measured."""
    for v in range(pixel.size):
        texel = texture[max(pixel[v], 0)]
        t = np.float64(texel[0]) - distance[v]
        inside = min(max(t, -WINDOW_M), WINDOW_M)
        inverse[v] = texel[3] + inside * (texel[4] + inside * texel[5])
        residual[v] = (t - texel[1] - texel[2] * inside) * inverse[v]
        measured[v] = pixel[v] > 0 and texel[3] > 0


@kernel
def depth_cost(
    pixel: NDArray[np.int32],
    distance: NDArray[np.float32],
    texture: NDArray[np.float32],
    inlier: float,
    outlier: float,
    out: NDArray[np.float64],
) -> None:
    """Sum over samples of min(inlier + ½e² + log normaliser, outlier), without that bound where nothing is measured.

    Texture as `write_texture` makes it.
    """
    window, ceiling, least = np.float32(WINDOW_M), np.float32(outlier - inlier), np.float32(inlier)
    unbounded = np.float32(1e30)
    # No branches on what is measured: whether an outlier's bound is reached cannot be foreseen, and each wrong guess
    # takes the processor as long as several samples.
    for k in prange(pixel.shape[0]):
        total, pixels, distances = 0.0, pixel[k], distance[k]
        for v in range(np.uintp(pixels.size)):
            i = pixels[v]
            texel = texture[np.uintp(max(i, 0))]
            t = texel[0] - distances[v]
            inside = min(max(t, -window), window)
            e = (t - texel[1] - texel[2] * inside) * (texel[3] + inside * (texel[4] + inside * texel[5]))
            cost = np.float32(0.5) * e * e + texel[6] + texel[7] * inside
            bounded = min(cost, ceiling if texel[3] > 0 else unbounded) + least
            total += bounded if i >= 0 else np.float32(0)
        out[k] = total


#: What `judge` looks through; `composed` puts another in its place.
see: Callable[..., Any] = sampling.see


@kernel
def judge(
    thetas: NDArray[np.float64],
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
    texture: NDArray[np.float32],
    inlier: float,
    outlier: float,
    *seeing: Any,
) -> float:
    """What `depth_cost` says of one candidate of a chain, after `see` with the arguments that it takes."""
    out = np.empty(1)
    pixel, distance = see(vertices, normals, *seeing)
    depth_cost(pixel, distance, texture, inlier, outlier, out)
    return out[0]
