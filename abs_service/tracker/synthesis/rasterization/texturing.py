"""Appearance at a finer resolution than the mesh: sampled on a lattice in every face, interpolated in between."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.synthesis.rasterization.zbuffer import Samples
from calib.jit import kernel


def lattice(mesh: Mesh, detail: int) -> Mesh:
    """Lattice of points at which the appearance is sampled, as a mesh.

    Args:
        mesh: with m faces.
        detail: parts of every edge.

    Returns:
        m · (detail + 1)(detail + 2)/2 vertices, face by face. On a face with the corners a, b, c these are
        a + (b − a) i/detail + (c − a) j/detail for all i + j ≤ detail, i running first. Their colours are unknown.
    """
    i, j = _places(detail)
    a, b, c = (mesh.vertices[corner][:, None] for corner in mesh.faces.T)
    chart_a, chart_b, chart_c = (mesh.chart[corner][:, None] for corner in mesh.faces.T)
    across, along = i[:, None] / detail, j[:, None] / detail
    vertices = (a + (b - a) * across + (c - a) * along).reshape(-1, 3)
    chart = (chart_a + (chart_b - chart_a) * across + (chart_c - chart_a) * along).reshape(-1, 2)
    starts = np.arange(len(mesh.faces))[:, None, None] * len(i)
    faces = (starts + _small_faces(detail)).reshape(-1, 3).astype(np.int32)
    return Mesh(vertices, faces, np.full((len(vertices), 3), np.nan, np.float32), chart)


def paint(values: NDArray[np.float32], detail: int, samples: Samples) -> NDArray[np.float32]:
    """Attributes (population, channels, m) of samples, from those at lattice points (k, channels), linear between."""
    population, m = samples.pixel.shape
    result = np.empty((population, values.shape[1], m), np.float32)
    _paint(values, detail, samples, result)
    return result


def _places(detail: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices i and j of all lattice points of a face."""
    i, j = np.meshgrid(np.arange(detail + 1), np.arange(detail + 1))
    return i[i + j <= detail], j[i + j <= detail]


def _small_faces(detail: int) -> NDArray[np.int64]:
    """Sub-triangles (detail², 3) between the lattice points of one face, with its orientation."""
    i, j = _places(detail)
    number = {place: n for n, place in enumerate(zip(i.tolist(), j.tolist()))}
    lower = [[(p, q), (p + 1, q), (p, q + 1)] for p, q in number if p + q < detail]
    upper = [[(p + 1, q + 1), (p, q + 1), (p + 1, q)] for p, q in number if p + q < detail - 1]
    return np.array([[number[place] for place in face] for face in lower + upper])


@kernel
def _paint(values: NDArray[np.float32], detail: int, samples: Samples, result: NDArray[np.float32]) -> None:
    """Linear interpolation within the sub-triangle that contains each sample."""
    face, weights = samples.face, samples.weights
    one = np.float32(1)
    points = (detail + 1) * (detail + 2) // 2
    for k in range(face.shape[0]):
        for s in range(face.shape[1]):
            b, c = max(weights[k, s, 1], np.float32(0)) * detail, max(weights[k, s, 2], np.float32(0)) * detail
            i, j = min(int(b), detail - 1), min(int(c), detail - 1)
            if i + j >= detail:  # on the edge opposite to the first corner
                i, j = (i - 1, j) if i > 0 else (i, j - 1)
            b, c = b - np.float32(i), c - np.float32(j)
            row = face[k, s] * points + j * (detail + 1) - j * (j - 1) // 2
            above = row + detail + 1 - j
            if b + c <= one or i + j == detail - 1:
                first, second, third = row + i, row + i + 1, above + i
                at_second, at_third = b, c
            else:
                first, second, third = above + i + 1, above + i, row + i + 1
                at_second, at_third = one - b, one - c
            at_first = one - at_second - at_third
            for channel in range(values.shape[1]):
                total = at_first * values[first, channel] + at_second * values[second, channel]
                result[k, channel, s] = total + at_third * values[third, channel]
