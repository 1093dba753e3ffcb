"""Derivatives of residuals with respect to vertex positions, for the Gauss–Newton curvature of the objective."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.synthesis.perspective import project_with_jacobian
from abs_service.tracker.terms.image_noise import noise_deviation
from calib.camera import Camera
from calib.jit import kernel

#: Half the side of the neighbourhood from which the image gradient at a vertex is estimated [px].
RADIUS_PX = 2
_STEPS = np.arange(-RADIUS_PX, RADIUS_PX + 1.0)

#: Weights of the neighbourhood: a Gaussian with σ of one pixel; and those of a linear regression on the steps.
_BELL = np.exp(-0.5 * (_STEPS**2 + _STEPS[:, None] ** 2))
_REGRESSION = _BELL / np.sum(_BELL * _STEPS**2)

#: Variance of an image gradient, along one axis, by independent noise of the pixels of variance 1 [1/px²].
_NOISE_GAIN = float(np.sum((_REGRESSION * _STEPS) ** 2))

#: The noise's deviation is a median, so its share in the mean square of m rows is known to 2.5/√m. Two such deviations
#: more are taken away.
_NOISE_SCATTER = 5.0

#: Smallest cosine between line of sight and normal; at grazing views a row would grow without bound.
MIN_COSINE = 0.2


def depth_rows(
    vertices: NDArray[np.floating],
    normals: NDArray[np.floating],
    center: NDArray[np.float64],
    use: NDArray[np.intp],
    weight: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Derivatives (m, 3) of weighted measured − synthesised distances with respect to the selected vertices.

    A vertex that slides along the surface keeps its residual, because the measurement moves with the pixel. Only its
    motion along the normal counts, divided by the cosine between normal and line of sight (point-to-plane).

    Args:
        vertices, normals: positions [m] and unit normals (n, 3).
        center: camera centre c_s (3,) [m].
        use: indices of these vertices (m,).
        weight: of each vertex' distance (n,) [1/m].
    """
    rows = np.empty((len(use), 3))
    _depth_rows(vertices, normals, center, use, weight, rows)
    return rows


def color_rows(
    image: NDArray[np.float32] | NDArray[np.uint8], camera: Camera, vertices: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Derivatives (n, channels, 3) of the measurement at a vertex's pixel with respect to the vertex [image unit / m].

    Args:
        image: measured values (height, width, channels), for example colours; unknown pixels are NaN and have zero
            gradient.
        camera: its camera.
        vertices: positions (n, 3) [m].
    """
    return _image_rows(image, *project_with_jacobian(camera, vertices), np.ones((1, image.shape[2])))


def noiseless_color_rows(
    image: NDArray[np.float32] | NDArray[np.uint8],
    camera: Camera,
    vertices: NDArray[np.floating],
    weight: NDArray[np.floating],
) -> NDArray[np.float64]:
    """Weighted `color_rows` that the noise of the pixels makes no longer than the picture's gradients make them.

    Noise has gradients as a print has, and the more of it there is, the better it would seem to hold a surface without
    print. Its share in the mean square of the rows is known from its deviation, and taken away from all alike.

    Args:
        image, camera, vertices: see `color_rows`.
        weight: of the measurements (n or 1, channels) [1/image unit].
    """
    places, projection = project_with_jacobian(camera, vertices)
    rows = _image_rows(image, places, projection, weight)
    weighted = np.square(noise_deviation(image, places) * weight).sum(axis=1)
    entries = projection.reshape(len(projection), 6)
    return _shortened(rows, _NOISE_GAIN * float(np.sum(weighted * np.vecdot(entries, entries))))


def _shortened(rows: NDArray[np.float64], noise: float) -> NDArray[np.float64]:
    """Rows without the share that noise has in the sum of their squares, taken away from all alike.

    Args:
        rows: (…, 3).
        noise: what it adds to the sum of their squares.
    """
    most = noise * (1 + _NOISE_SCATTER / max(np.sqrt(rows.size / 3), 1.0))
    return rows * np.sqrt(max(1 - most / max(float(np.vdot(rows, rows)), 1e-300), 0.0))


def _image_rows(
    image: NDArray[np.float32] | NDArray[np.uint8],
    places: NDArray[np.float64],
    projection: NDArray[np.float64],
    weight: NDArray[np.floating],
) -> NDArray[np.float64]:
    """Weighted (n or 1, channels) `color_rows` at places (n, 2), with the Jacobians of the projection (n, 2, 3)."""
    rows = np.empty((len(places), image.shape[2], 3))
    _color_rows(image, places, _REGRESSION, projection, weight, rows)
    return rows


def channel_gradients(
    values: NDArray[np.float32],
    channels: NDArray[np.float32],
    camera: Camera,
    vertices: NDArray[np.floating],
) -> NDArray[np.float64]:
    """Image gradient at a vertex's pixel, to the right and down (n, 2) [image unit / px].

    In a Bayer mosaic the gradient is that of the pixels with the same channel; differences between channels are no
    gradient of the surface.

    Args:
        values: image (height, width), NaN where unknown.
        channels: channel (height, width) of every pixel.
        camera: its camera.
        vertices: positions (n, 3) [m].
    """
    column, row = _neighborhood(_pixels(camera, vertices), values.shape)
    patches = values[row, column].astype(np.float64)
    same = channels[row, column] == channels[row[:, RADIUS_PX], column[:, :, RADIUS_PX]][..., None]
    weights = _BELL * (same & np.isfinite(patches))
    patches = np.where(weights > 0, patches, 0.0)
    return np.stack([_slope(patches, weights, steps) for steps in (_STEPS, _STEPS[:, None])], axis=-1)


def _slope(
    patches: NDArray[np.float64], weights: NDArray[np.float64], steps: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Weighted regression slope (n,) of patches (n, rows, columns) along one axis; 0 without data."""
    total = np.maximum(weights.sum(axis=(1, 2)), 1e-12)
    mean = (weights * steps).sum(axis=(1, 2)) / total
    centered = weights * (steps - mean[:, None, None])
    spread = (centered * (steps - mean[:, None, None])).sum(axis=(1, 2))
    regression = np.where(spread > 1e-6, 1 / np.maximum(spread, 1e-6), 0.0)[:, None, None] * centered
    return np.asarray((regression * patches).sum(axis=(1, 2)))


def _pixels(camera: Camera, vertices: NDArray[np.floating]) -> NDArray[np.intp]:
    """Pixel (n, 2) of each vertex (n, 3)."""
    return np.floor(camera.project(np.asarray(vertices, np.float64)) + 0.5).astype(int)


def _neighborhood(pixels: NDArray[np.intp], shape: tuple[int, ...]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Columns (n, 1, k) and rows (n, k, 1) around pixels (n, 2), as indices of an image.

    Restricted to the vertices' pixels; an image has a thousand times as many.
    """
    steps = _STEPS.astype(int)
    column = np.clip(pixels[:, :1] + steps, 0, shape[1] - 1)
    row = np.clip(pixels[:, 1:] + steps, 0, shape[0] - 1)
    return column[:, None, :], row[:, :, None]


@kernel
def _depth_rows(
    vertices: NDArray[np.floating],
    normals: NDArray[np.floating],
    center: NDArray[np.float64],
    use: NDArray[np.intp],
    weight: NDArray[np.float64],
    rows: NDArray[np.float64],
) -> None:
    """Weighted normals (m, 3) divided by the cosine between normal and line of sight from a centre (3,)."""
    for k in range(use.size):
        v = use[k]
        x, y, z = vertices[v, 0] - center[0], vertices[v, 1] - center[1], vertices[v, 2] - center[2]
        along = normals[v, 0] * x + normals[v, 1] * y + normals[v, 2] * z
        cosine = min(along / np.sqrt(x * x + y * y + z * z), -MIN_COSINE)
        for i in range(3):
            rows[k, i] = -normals[v, i] * weight[v] / cosine


@kernel
def _color_rows(
    image: NDArray[np.float32] | NDArray[np.uint8],
    places: NDArray[np.float64],
    weights: NDArray[np.float64],
    projection: NDArray[np.float64],
    scales: NDArray[np.floating],
    rows: NDArray[np.float64],
) -> None:
    """Image gradients at places (n, 2) by regression, times the Jacobians of the projection (n, 2, 3) and scales."""
    height, width, channels = image.shape
    side, reach = weights.shape[0], weights.shape[0] // 2
    x, y = np.empty(side, np.int64), np.empty(side, np.int64)
    for v in range(places.shape[0]):
        column, row = int(np.floor(places[v, 0] + 0.5)), int(np.floor(places[v, 1] + 0.5))
        for i in range(side):  # once for all channels
            x[i] = min(max(column + i - reach, 0), width - 1)
            y[i] = min(max(row + i - reach, 0), height - 1)
        own = image[y[reach], x[reach]]
        for c in range(channels):
            right, down = 0.0, 0.0
            for i in range(side):
                for j in range(side):
                    color = image[y[i], x[j], c]
                    value = weights[i, j] * (own[c] if np.isnan(color) else color)
                    right += (j - reach) * value
                    down += (i - reach) * value
            scale = scales[v if scales.shape[0] > 1 else 0, c]
            for k in range(3):
                rows[v, c, k] = (right * projection[v, 0, k] + down * projection[v, 1, k]) * scale
