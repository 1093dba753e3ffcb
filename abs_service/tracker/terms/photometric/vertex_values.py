"""Values of an image at the vertices of a mesh."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import ChannelImage, ColorImage, Image
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.terms.photometric.demosaicing import demosaiced
from calib.camera import Camera

#: One row per vertex, (n, channels); NaN where unknown.
Values = NDArray[np.float64]


def at_vertices(image: Image, camera: Camera, mesh: Mesh) -> Values:
    """Values of an image at the vertices (n, channels), interpolated bilinearly; NaN where unknown."""
    match image:
        case ColorImage():
            return _between(image.rgb, camera, mesh.vertices)
        case ChannelImage() if image.channels.size > 1:
            return _between(demosaiced(image.values, image.channel), camera, mesh.vertices)
        case ChannelImage():
            return _between(image.values[..., None], camera, mesh.vertices)
    return np.full((len(mesh.vertices), 1), np.nan)


def _between(values: NDArray[np.generic], camera: Camera, points: Values) -> Values:
    """Bilinear interpolation (n, c) among those of the four pixels (height, width, c) around a point that are known."""
    height, width, channels = values.shape
    place = _place(camera, points)
    inside = np.isfinite(place).all(axis=1)
    result = np.full((len(points), channels), np.nan)
    corner = np.floor(place[inside]).astype(int)
    steps = np.arange(2)
    column, row = corner[:, :1] + steps, corner[:, 1:] + steps
    across, down = (np.maximum(1 - np.abs(part - place[inside, i, None]), 0) for i, part in enumerate((column, row)))
    valid = ((row >= 0) & (row < height))[:, :, None] & ((column >= 0) & (column < width))[:, None, :]
    row, column = np.clip(row, 0, height - 1)[:, :, None], np.clip(column, 0, width - 1)[:, None, :]
    corners = values[row, column].astype(np.float64)
    finite = np.isfinite(corners)
    weights = (down[:, :, None] * across[:, None, :] * valid)[..., None] * finite
    total = weights.sum(axis=(1, 2))
    filled = np.where(finite, corners, 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        result[inside] = np.where(total > 0, (weights * filled).sum(axis=(1, 2)) / total, np.nan)
    return result


def _place(camera: Camera, points: Values) -> Values:
    """Pixel coordinates (n, 2) of points; NaN for what is outside the image, or only folded into it by the lens."""
    place = camera.project(points)
    pixel = np.floor(place + 0.5)
    with np.errstate(invalid="ignore"):
        inside = np.all((pixel >= 0) & (pixel < (camera.width, camera.height)), axis=1)
    return np.where((inside & camera.in_field(points))[:, None], place, np.nan)


def known(values: Values, others: Values) -> Values:
    """The values, and the others where they are unknown."""
    return np.where(np.isfinite(values), values, others)


def mean_of_known(parts: Sequence[Values], shape: tuple[int, int]) -> Values:
    """Mean of the known values; NaN without any."""
    total, count = np.zeros(shape), np.zeros(shape)
    for part in parts:
        there = np.isfinite(part)
        total[there] += part[there]
        count[there] += 1
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
