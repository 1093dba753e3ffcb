"""A z-buffer for a population of meshes: which face every pixel shows, how far away, and where on the face."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """The pixels that every member of a population covers; those that cover fewer than others have −1 at the end.

    Attributes:
        pixel: index (population, m) into the flattened image with a border of one pixel; 0 where a face shows its back;
            −1 where there is no sample.
        distance: radial distance (population, m) [m].
        face: index (population, m) of the face.
        weights: of the face's three corners (population, m, 3), right in perspective.
    """

    pixel: NDArray[np.int32]
    distance: NDArray[np.float32]
    face: NDArray[np.int32]
    weights: NDArray[np.float32]


def render(
    place: NDArray[np.float32],
    inverse_z: NDArray[np.float32],
    faces: NDArray[np.int32],
    ray_length: NDArray[np.float32],
    step: int,
) -> Samples:
    """Renders a population.

    Args:
        place: pixel coordinates (population, n, 2) of the vertices.
        inverse_z: their 1/z (population, n), NaN where the camera cannot see them.
        faces: vertex indices (m, 3), anticlockwise around the normal.
        ray_length: radial distance per z of every pixel (height, width).
        step: only every so many rows and columns.
    """
    population = len(place)
    shape = (population, *(-(-side // step) for side in ray_length.shape))
    nearness, face = np.zeros(shape, np.float32), np.full(shape, -1, np.int32)
    for k in range(population):
        _rasterize(place[k], inverse_z[k], faces, step, nearness[k], face[k])
    most = int(np.count_nonzero(face >= 0, axis=(1, 2)).max(initial=0))
    samples = Samples(
        np.full((population, most), -1, np.int32),
        np.ones((population, most), np.float32),
        np.zeros((population, most), np.int32),
        np.zeros((population, most, 3), np.float32),
    )
    _collect(
        nearness,
        face,
        place,
        inverse_z,
        faces,
        ray_length,
        step,
        samples.pixel,
        samples.distance,
        samples.face,
        samples.weights,
    )
    return samples


def interpolate(values: NDArray[np.float32], faces: NDArray[np.int32], samples: Samples) -> NDArray[np.float32]:
    """Values (population or 1, n, channels) of the vertices at the samples (population, m, channels)."""
    result = np.empty((*samples.pixel.shape, values.shape[2]), np.float32)
    _interpolate(values, faces, samples.face, samples.weights, result)
    return result


@kernel
def _rasterize(
    place: NDArray[np.float32],
    inverse_z: NDArray[np.float32],
    faces: NDArray[np.int32],
    step: int,
    nearness: NDArray[np.float32],
    face: NDArray[np.int32],
) -> None:
    """Nearest face and its 1/z at every `step`-th pixel of one mesh; `nearness` begins at 0, `face` at −1."""
    height, width = nearness.shape
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        if np.isnan(inverse_z[a] + inverse_z[b] + inverse_z[c]):
            continue
        ax, ay, bx, by = place[a, 0], place[a, 1], place[b, 0], place[b, 1]
        cx, cy = place[c, 0], place[c, 1]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0:
            continue
        first_row = max(int(np.ceil(min(ay, by, cy) / step)), 0)
        last_row = min(int(np.floor(max(ay, by, cy) / step)), height - 1)
        first_column = max(int(np.ceil(min(ax, bx, cx) / step)), 0)
        last_column = min(int(np.floor(max(ax, bx, cx) / step)), width - 1)
        for row in range(first_row, last_row + 1):
            for column in range(first_column, last_column + 1):
                x, y = np.float32(column * step), np.float32(row * step)
                at_b = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area
                at_c = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area
                at_a = 1 - at_b - at_c
                if at_a >= 0 and at_b >= 0 and at_c >= 0:
                    near = at_a * inverse_z[a] + at_b * inverse_z[b] + at_c * inverse_z[c]
                    if near > nearness[row, column]:
                        nearness[row, column] = near
                        face[row, column] = f


@kernel
def _collect(
    nearness: NDArray[np.float32],
    face: NDArray[np.int32],
    place: NDArray[np.float32],
    inverse_z: NDArray[np.float32],
    faces: NDArray[np.int32],
    ray_length: NDArray[np.float32],
    step: int,
    pixel: NDArray[np.int32],
    distance: NDArray[np.float32],
    index: NDArray[np.int32],
    weights: NDArray[np.float32],
) -> None:
    """Gathers the covered pixels (population, height, width), row by row, into the arrays of `Samples`."""
    population, height, width = face.shape
    stride = ray_length.shape[1] + 2
    for k in range(population):
        i = 0
        for row in range(height):
            for column in range(width):
                f = face[k, row, column]
                if f < 0:
                    continue
                a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
                ax, ay = place[k, a, 0], place[k, a, 1]
                bx, by = place[k, b, 0] - ax, place[k, b, 1] - ay
                cx, cy = place[k, c, 0] - ax, place[k, c, 1] - ay
                x, y = np.float32(column * step) - ax, np.float32(row * step) - ay
                area = bx * cy - by * cx
                at_b, at_c = (x * cy - y * cx) / area, (bx * y - by * x) / area
                z = 1 / nearness[k, row, column]
                # The image's y axis points down: faces that turn clockwise in it show their front.
                pixel[k, i] = (row * step + 1) * stride + column * step + 1 if area < 0 else 0
                distance[k, i] = ray_length[row * step, column * step] * z
                index[k, i] = f
                weights[k, i, 0] = (1 - at_b - at_c) * inverse_z[k, a] * z
                weights[k, i, 1] = at_b * inverse_z[k, b] * z
                weights[k, i, 2] = at_c * inverse_z[k, c] * z
                i += 1


@kernel
def _interpolate(
    values: NDArray[np.float32],
    faces: NDArray[np.int32],
    index: NDArray[np.int32],
    weights: NDArray[np.float32],
    result: NDArray[np.float32],
) -> None:
    """Weighted sums (population, m, channels) of the corners' values (population or 1, n, channels)."""
    for k in range(index.shape[0]):
        own = k % values.shape[0]
        for i in range(index.shape[1]):
            a, b, c = faces[index[k, i], 0], faces[index[k, i], 1], faces[index[k, i], 2]
            at_a, at_b, at_c = weights[k, i, 0], weights[k, i, 1], weights[k, i, 2]
            for channel in range(values.shape[2]):
                total = at_a * values[own, a, channel] + at_b * values[own, b, channel]
                result[k, i, channel] = total + at_c * values[own, c, channel]
