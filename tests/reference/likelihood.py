"""Costs of measurements given vertices (eqs. 16–22)."""

import numpy as np

from calib.camera import Camera
from calib.noise.base import DepthNoise
from calib.noise.images.bayer import GaussianBayer
from calib.noise.images.grey import GaussianGrey
from calib.noise.images.intensity import GaussianIntensity
from tests.reference.cameras import distance_at_center, project, seen_pixel

#: Noise of one number per pixel.
ChannelNoise = GaussianGrey | GaussianBayer | GaussianIntensity


def depth_cost(  # one argument per symbol
    camera: Camera,
    noise: DepthNoise,
    image: np.ndarray,
    amplitude: np.ndarray,
    vertices: np.ndarray,
    normals: np.ndarray,
    outlier_share: float,
    range_m: float,
) -> float:
    """−Σ_v log φ (17–19), where φ is the larger of (1 − ε) times the Gaussian and ε times the uniform density.

    A vertex that is not seen, or is seen by a pixel without a return, has the uniform density in the Gaussian's place.
    """
    total = 0.0
    for vertex, normal in zip(vertices, normals):
        pixel = seen_pixel(camera, vertex, normal)
        density = 1 / range_m
        if pixel is not None and np.isfinite(image[pixel]):
            x, a = np.array([distance_at_center(camera, vertex, normal)]), np.array([float(amplitude[pixel])])
            p = (np.array([pixel[0]]), np.array([pixel[1]]))
            sigma = noise.deviation(x, a, p)[0]
            e = (image[pixel] - x[0] - noise.mean(x, a, p)[0]) / sigma
            density = np.exp(-0.5 * e**2) / (np.sqrt(2 * np.pi) * sigma)
        total -= np.log(max((1 - outlier_share) * density, outlier_share / range_m))
    return float(total)


def color_cost(
    camera: Camera,
    sigma: float | np.ndarray,
    image: np.ndarray,
    colors: np.ndarray,
    vertices: np.ndarray,
    normals: np.ndarray,
    outlier_share: float,
) -> float:
    """−Σ_v log of the density of the measured colour given the vertex's; uniform where one of them is unknown.

    The deviation σ is one, or one of every vertex and channel (n, 3).
    """
    total, uniform = 0.0, 256.0**-3
    for vertex, normal, color, own in zip(vertices, normals, colors, np.broadcast_to(sigma, colors.shape)):
        pixel = seen_pixel(camera, vertex, normal)
        density = uniform
        if pixel is not None and np.all(np.isfinite(color)):
            e = (image[pixel].astype(float) - color) / own
            density = np.exp(-0.5 * e @ e) / np.prod(np.sqrt(2 * np.pi) * own)
        total -= np.log(max((1 - outlier_share) * density, outlier_share * uniform))
    return float(total)


def picture_deviation(noise: ChannelNoise, values: np.ndarray | float) -> np.ndarray:
    """σ of numbers of a picture that have these values."""
    relative = noise.relative if isinstance(noise, GaussianIntensity) else 0.0
    return np.sqrt(noise.sigma**2 + (relative * np.asarray(values)) ** 2)


def channel_cost(  # one argument per symbol
    camera: Camera,
    noise: ChannelNoise,
    image: np.ndarray,
    channel: np.ndarray,
    covered: np.ndarray,
    looks: np.ndarray,
    vertices: np.ndarray,
    normals: np.ndarray,
    outlier_share: float,
    widening: np.ndarray | float = 1.0,
) -> float:
    """−Σ_v log of the density of the measured number given the vertex's own in the channel that its pixel has.

    Uniform where one of them is unknown; where something covers the object, what an agreeing number costs on average.
    The deviation is that of the measured number, widened for every vertex and channel (n, channels).
    """
    total, uniform = 0.0, np.exp(-noise.uniform)
    for vertex, normal, look, wider in zip(vertices, normals, looks, np.broadcast_to(widening, looks.shape)):
        pixel = seen_pixel(camera, vertex, normal)
        density = uniform
        if pixel is not None and np.isfinite(image[pixel]) and np.isfinite(look[channel[pixel]]):
            sigma = picture_deviation(noise, float(image[pixel])) * wider[channel[pixel]]
            if covered[pixel]:
                total += 0.5 + np.log(np.sqrt(2 * np.pi) * sigma) - np.log(1 - outlier_share)
                continue
            e = (float(image[pixel]) - look[channel[pixel]]) / sigma
            density = np.exp(-0.5 * e**2) / (np.sqrt(2 * np.pi) * sigma)
        total -= np.log(max((1 - outlier_share) * density, outlier_share * uniform))
    return float(total)


def lambert(vertex: np.ndarray, normal: np.ndarray, lamp: np.ndarray) -> float:
    """Cosine of incidence over squared distance; 0 where the vertex faces away from the lamp."""
    d = float(np.linalg.norm(lamp - vertex))
    return max(float(normal @ (lamp - vertex)) / d, 0.0) / d**2


def meeting_point(begin: np.ndarray, end: np.ndarray, triangle: np.ndarray) -> np.ndarray:
    """(s, t, q) of begin + q (end − begin) = a + s (b − a) + t (c − a), for a triangle (3, 3) of a, b, c."""
    a, b, c = triangle
    return np.linalg.solve(np.column_stack([b - a, c - a, begin - end]), begin - a)


def stretch_cost(rest: np.ndarray, vertices: np.ndarray, edges: np.ndarray, deviation: float) -> float:
    """½ Σ (relative change of length / deviation)² over the edges."""
    total = 0.0
    for i, j in edges:
        before, now = np.linalg.norm(rest[i] - rest[j]), np.linalg.norm(vertices[i] - vertices[j])
        total += 0.5 * ((now / before - 1) / deviation) ** 2
    return float(total)


def rim_cost(  # one argument per symbol
    camera: Camera,
    vertices: np.ndarray,
    outer: np.ndarray,
    inner: np.ndarray,
    beyond: np.ndarray,
    corner: np.ndarray,
    inwards: np.ndarray,
    deviation: float,
    maximum: float,
) -> float:
    """½ Σ min(d/σ, farthest)² of the rim, extrapolated from the inner vertices; d is unknown outside the image part."""
    total = 0.0
    for end, inside, share in zip(vertices[outer], vertices[inner], beyond):
        u, v = project(camera, end + share * (end - inside)) - corner
        square = maximum**2
        if 0 <= u < inwards.shape[1] - 1 and 0 <= v < inwards.shape[0] - 1:
            (column, f), (row, g) = (int(u), u % 1), (int(v), v % 1)
            d = np.array([1 - g, g]) @ inwards[row : row + 2, column : column + 2].astype(float) @ np.array([1 - f, f])
            square = np.fmin((d / deviation) ** 2, square)
        total += 0.5 * square
    return float(total)
