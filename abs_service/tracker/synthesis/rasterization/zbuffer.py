"""A z-buffer for a population of meshes: visible face, distance and barycentric coordinates of every pixel."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.synthesis.projection import Projected, extent
from abs_service.tracker.synthesis.rasterization.face_in_image import face_in_image
from calib.jit import kernel
from calib.warp.triangle import columns_of, rows_of, weights_at


class Samples(NamedTuple):
    """Pixels that every candidate of a population covers, padded with −1 to a common number m.

    Attributes:
        pixel: index (population, m) into the flattened image with a border of one pixel; 0 for back faces; −1 where
            there is no sample.
        distance: radial distance (population, m) [m].
        face: index (population, m) of the face.
        weights: perspective-correct barycentric weights of the face's corners (population, m, 3).
        covered: number of samples (population,).
    """

    pixel: NDArray[np.int32]
    distance: NDArray[np.float32]
    face: NDArray[np.int32]
    weights: NDArray[np.float32]
    covered: NDArray[np.int64]


class Grid(NamedTuple):
    """Every `step`-th row and column of an image, from (top, left) · step."""

    step: int
    top: int
    left: int


class Nearest(NamedTuple):
    """The nearest faces of a population in a grid of pixels (rows, columns).

    Attributes:
        inverse_z: 1/z (population, rows, columns) [1/m]; 0 without a face.
        face: its index (population, rows, columns); −1 without.
    """

    inverse_z: NDArray[np.float32]
    face: NDArray[np.int32]


def render(seen: Projected, faces: NDArray[np.int32], ray_length: NDArray[np.float32], step: int) -> Samples:
    """Renders a population.

    Args:
        seen: the projected vertices.
        faces: vertex indices (m, 3), anticlockwise around the normal.
        ray_length: radial distance per z of every pixel (height, width).
        step: spacing of the sampled rows and columns [px].
    """
    population = len(seen.place)
    grid, size = _box(seen, ray_length.shape, step)
    nearest = Nearest(np.empty((population, *size), np.float32), np.empty((population, *size), np.int32))
    count = np.zeros(population, np.int64)
    _rasterize(seen, faces, grid, nearest, count)
    maximum = int(count.max(initial=0))
    samples = Samples(
        np.full((population, maximum), -1, np.int32),
        np.ones((population, maximum), np.float32),
        np.zeros((population, maximum), np.int32),
        np.zeros((population, maximum, 3), np.float32),
        count,
    )
    _collect(seen, faces, grid, nearest, ray_length, samples)
    return samples


def interpolate(values: NDArray[np.float32], faces: NDArray[np.int32], samples: Samples) -> NDArray[np.float32]:
    """Interpolates values (population or 1, n, channels) of the vertices at the samples (population, m, channels)."""
    result = np.empty((*samples.pixel.shape, values.shape[2]), np.float32)
    _interpolate(values, faces, samples, result)
    return result


def _box(seen: Projected, shape: tuple[int, ...], step: int) -> tuple[Grid, tuple[int, int]]:
    """Grid over the bounding box of a population in an image, and its numbers of rows and columns."""
    low, high = extent(seen)
    if high[0] < low[0]:
        return Grid(step, 0, 0), (0, 0)
    most = -(-np.array(shape) // step) - 1
    top, left = np.clip(np.ceil(low / step), 0, most).astype(int).tolist()
    bottom, right = np.clip(np.floor(high / step), -1, most).astype(int).tolist()
    return Grid(step, top, left), (max(bottom + 1 - top, 0), max(right + 1 - left, 0))


@kernel
def _rasterize(
    seen: Projected, faces: NDArray[np.int32], grid: Grid, nearest: Nearest, count: NDArray[np.int64]
) -> None:
    """Fills in the nearest faces, and counts the samples (population,), zeros at the start."""
    (step, top, left), (nearness, face) = grid, nearest
    height, width = nearness.shape[1:]
    one = np.float32(1)
    for k in range(nearness.shape[0]):
        nearness[k] = 0
        face[k] = -1
        for f in range(faces.shape[0]):
            at, near_a, near_b, near_c = face_in_image(seen, k, faces[f])
            if np.isnan(near_a + near_b + near_c) or at.area == 0:
                continue
            per_area = one / at.area
            (highest, lowest), (leftmost, rightmost) = rows_of(at), columns_of(at)
            first_row, last_row = int(np.ceil(highest / step)) - top, int(np.floor(lowest / step)) - top
            first_column, last_column = int(np.ceil(leftmost / step)) - left, int(np.floor(rightmost / step)) - left
            for row in range(max(first_row, 0), min(last_row, height - 1) + 1):
                for column in range(max(first_column, 0), min(last_column, width - 1) + 1):
                    y, x = np.float32((row + top) * step), np.float32((column + left) * step)
                    at_b, at_c = weights_at(at, per_area, y, x)
                    at_a = one - at_b - at_c
                    near = at_a * near_a + at_b * near_b + at_c * near_c
                    if at_a >= 0 and at_b >= 0 and at_c >= 0 and near > nearness[k, row, column]:
                        count[k] += 1 if face[k, row, column] < 0 else 0
                        nearness[k, row, column] = near
                        face[k, row, column] = f


@kernel
def _collect(
    seen: Projected,
    faces: NDArray[np.int32],
    grid: Grid,
    nearest: Nearest,
    ray_length: NDArray[np.float32],
    samples: Samples,
) -> None:
    """Gathers the covered pixels, row by row, into the samples."""
    (step, top, left), (nearness, face) = grid, nearest
    population, height, width = face.shape
    stride, one = ray_length.shape[1] + 2, np.float32(1)
    for k in range(population):
        i = 0
        for row in range(height):
            for column in range(width):
                f = face[k, row, column]
                if f < 0:
                    continue
                at, near_a, near_b, near_c = face_in_image(seen, k, faces[f])
                y, x = (row + top) * step, (column + left) * step
                at_b, at_c = weights_at(at, one / at.area, np.float32(y), np.float32(x))
                z = 1 / nearness[k, row, column]
                # The image's y axis points down: faces that are clockwise in it are front faces.
                samples.pixel[k, i] = (y + 1) * stride + x + 1 if at.area < 0 else 0
                samples.distance[k, i] = ray_length[y, x] * z
                samples.face[k, i] = f
                samples.weights[k, i, 0] = (one - at_b - at_c) * near_a * z
                samples.weights[k, i, 1] = at_b * near_b * z
                samples.weights[k, i, 2] = at_c * near_c * z
                i += 1


@kernel
def _interpolate(
    values: NDArray[np.float32], faces: NDArray[np.int32], samples: Samples, result: NDArray[np.float32]
) -> None:
    """Weighted sums (population, m, channels) of the corners' values (population or 1, n, channels)."""
    index, weights = samples.face, samples.weights
    for k in range(index.shape[0]):
        own = k % values.shape[0]
        for i in range(index.shape[1]):
            a, b, c = faces[index[k, i], 0], faces[index[k, i], 1], faces[index[k, i], 2]
            at_a, at_b, at_c = weights[k, i, 0], weights[k, i, 1], weights[k, i, 2]
            for channel in range(values.shape[2]):
                total = at_a * values[own, a, channel] + at_b * values[own, b, channel]
                result[k, i, channel] = total + at_c * values[own, c, channel]
