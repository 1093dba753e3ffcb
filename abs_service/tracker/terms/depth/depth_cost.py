"""Kernels of the cost of measured distances; textures as written by `calib.noise.texture.write_texture`."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import Surface
from abs_service.tracker.terms.base import line_of_sight
from calib.jit import kernel, prange
from calib.no_return import NoReturn
from calib.noise.texture import WINDOW_M

#: Distance from the object that costs a vertex in free space one unit of log-likelihood: the outline errs by a Laplace
#: distribution of this scale [m].
FREE_SCALE_M = 0.01

#: Number of texels that are gathered first, and then compared at once.
_TILE = 64


class ConstantCosts(NamedTuple):
    """Costs of the pixels of a window (rows, columns) that have no usable distance [nats].

    Attributes:
        masked: behind an occluder, in a hole, or left to the outline.
        distance: measured distances [m], NaN where unknown.
        free_m: distance from the object where the sensor looks past it [m], else 0.
        missing: texel (8,) of a missing return.
        agreeing: cost of a masked pixel, that of an inlier.
        outlier: cost of a pixel in free space at the end of the object.
    """

    masked: NDArray[np.bool_]
    distance: NDArray[np.float32]
    free_m: NDArray[np.float32]
    missing: NDArray[np.float32]
    agreeing: float
    outlier: float


class DepthResiduals(NamedTuple):
    """Measured distances compared with synthesised ones, each (n,).

    Attributes:
        normalized: residual, divided by its deviation.
        inverse_deviation: [1/m].
        cost: unbounded, infinite without a measurement [nats].
    """

    normalized: NDArray[np.float64]
    inverse_deviation: NDArray[np.float64]
    cost: NDArray[np.float64]


def missing_cost(law: NoReturn, predicted: Surface, center: NDArray[np.float64], maximum: float) -> NDArray[np.float32]:
    """Cost (1, n) of a missing return at each vertex beyond that of an agreeing measurement, up to `maximum` [nats].

    It is −log p of a missing return minus −log(1 − p) of a return, so it is 0 where no return is as likely as one.
    Distance and angle are those of the predicted mesh, the same for all candidates.

    Args:
        law: probability of no return.
        predicted: the predicted surface, a population of one.
        center: of the camera (3,) [m].
        maximum: upper bound [nats].
    """
    result = np.empty((1, predicted.vertices.shape[2]), np.float32)
    write_missing_cost(predicted.vertices[0], predicted.normals[0], center, law.coefficients, maximum, result[0])
    return result


@kernel
def write_missing_cost(
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
    center: NDArray[np.float64],
    law: tuple[float, float, float],
    maximum: float,
    cost: NDArray[np.float32],
) -> None:
    """Writes what `missing_cost` returns (n,) for vertices (3, n) [m], from the coefficients of `NoReturn`."""
    facing, per_m, grazing = law
    for v in range(cost.size):
        distance, along = line_of_sight(vertices, normals, v, center)
        cosine = min(max(-along / distance, 0.0), 1.0)
        odds = facing + per_m * (distance - 1) + grazing * (1 - cosine)
        cost[v] = min(max(-odds, 0.0), maximum)


def median_inlier_cost(texels: NDArray[np.float32], shown: NDArray[np.bool_]) -> float:
    """Median cost of an inlier on the object, given its mask (rows, columns); 0 for an empty mask."""
    normalizer = texels[..., 6][shown]  # plain NumPy: once a frame, and the compiler takes a second for a median
    return float(np.median(normalizer)) + 0.5 if normalizer.size else 0.0


@kernel
def distances(texels: NDArray[np.float32], found: NDArray[np.float32]) -> None:
    """Measured distance of every pixel (rows, columns), corrected for the mean offset [m]; NaN without return."""
    for row in range(found.shape[0]):
        for column in range(found.shape[1]):
            texel = texels[row, column]
            found[row, column] = texel[0] if texel[3] > 0 else np.float32(np.nan)


@kernel
def settle(row: int, column: int, costs: ConstantCosts, texel: NDArray[np.float32]) -> bool:
    """Writes the constant cost of a pixel without a usable distance into its texel (8,); False if it has one.

    At a distance d > 0 from the object, in free space, that is outlier + d / s; else at a masked pixel `agreeing`; else
    at a missing return the texel `missing`, see `depth_cost`.
    """
    free, is_masked = costs.free_m[row, column], costs.masked[row, column]
    if not (free > 0 or is_masked or np.isnan(costs.distance[row, column])):
        return False
    texel[:] = 0
    if free > 0:
        texel[6] = np.float32(costs.outlier) + free * np.float32(1 / FREE_SCALE_M)
    elif is_masked:
        texel[6] = np.float32(costs.agreeing)
    else:
        for i in range(costs.missing.size):
            texel[i] = costs.missing[i]
    return True


@kernel
def write_constants(costs: ConstantCosts, corner: tuple[int, int], texture: NDArray[np.float32]) -> None:
    """`settle` for all pixels of a window, which begins at (row, column), of a texture with a border of one pixel."""
    top, left = corner
    for row in range(costs.masked.shape[0]):
        for column in range(costs.masked.shape[1]):
            settle(row, column, costs, texture[top + row + 1, left + column + 1])


@kernel
def normalize(
    pixel: NDArray[np.int32], distance: NDArray[np.float32], texture: NDArray[np.float32], found: DepthResiduals
) -> None:
    """Writes the residuals of samples (n,), see `Synthesis`, with the texels (pixels, 8) of a texture."""
    for v in range(pixel.size):
        texel = texture[max(pixel[v], 0)]
        t = np.float64(texel[0]) - distance[v]
        inside = min(max(t, -WINDOW_M), WINDOW_M)
        inverse = texel[3] + inside * (texel[4] + inside * texel[5])
        residual = (t - texel[1] - texel[2] * inside) * inverse
        explained = 0.5 * residual * residual + texel[6] + texel[7] * inside
        found.normalized[v], found.inverse_deviation[v] = residual, inverse
        found.cost[v] = explained if pixel[v] > 0 and texel[3] > 0 else np.inf


@kernel
def depth_cost(
    pixel: NDArray[np.int32],
    distance: NDArray[np.float32],
    missing: NDArray[np.float32],
    texture: NDArray[np.float32],
    inlier: float,
    outlier: float,
    out: NDArray[np.float64],
) -> None:
    """`_cost_of` for every candidate of a population, (population, n).

    Args:
        pixel, distance: of the samples (population, n), see `Synthesis`.
        missing: cost of a missing return for each sample (population or 1, n).
        texture: texels (pixels, 8).
        inlier, outlier: see `Bounds`.
        out: costs (population,).
    """
    for k in prange(pixel.shape[0]):
        own = min(np.intp(k), missing.shape[0] - 1)  # a divided loop counts without sign
        out[k] = _cost_of(pixel[k], distance[k], missing[own], texture, inlier, outlier)


@kernel
def _cost_of(
    pixels: NDArray[np.int32],
    distances: NDArray[np.float32],
    missing: NDArray[np.float32],
    texture: NDArray[np.float32],
    inlier: float,
    outlier: float,
) -> float:
    """Sum over samples of min(inlier + ½e² + log normaliser, outlier), without that bound where nothing is measured.

    The texel of a missing return has a 1 in place of the normaliser's slope, that of a constant cost a 0.
    """
    window, ceiling, least = np.float32(WINDOW_M), np.float32(outlier - inlier), np.float32(inlier)
    half, none, unbounded, total = np.float32(0.5), np.float32(0), np.float32(1e30), 0.0
    texels = np.empty((_TILE, 8), np.float32)
    for first in range(0, pixels.size, _TILE):
        pixel, distance, lost = pixels[first:], distances[first:], missing[first:]
        count = np.uintp(min(_TILE, pixels.size - first))
        for v in range(count):
            # All is read before any is written, so that the compiler moves eight numbers at once.
            texel, to = texture[np.uintp(max(pixel[v], 0))], texels[v]
            a, b, c, d, e, f, g, h = texel[0], texel[1], texel[2], texel[3], texel[4], texel[5], texel[6], texel[7]
            to[0], to[1], to[2], to[3], to[4], to[5], to[6], to[7] = a, b, c, d, e, f, g, h
        part = none
        # No branches on what is measured: whether an outlier's bound is reached cannot be foreseen, and each wrong
        # guess takes the processor as long as several samples.
        for v in range(count):
            t = texels[v, 0] - distance[v]
            inside = min(max(t, -window), window)
            inverse = texels[v, 3] + inside * (texels[v, 4] + inside * texels[v, 5])
            e = (t - texels[v, 1] - texels[v, 2] * inside) * inverse
            measured = texels[v, 3] > 0
            cost = half * e * e + texels[v, 6] + texels[v, 7] * (inside if measured else lost[v])
            bounded = min(cost, ceiling if measured else unbounded) + least
            part += bounded if pixel[v] >= 0 else none
        total += part
    return float(total)
