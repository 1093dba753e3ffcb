"""Pixel and distance of every vertex of a population, one kernel per lens model."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.synthesis.projection import Optics
from calib.jit import composed, kernel, prange
from calib.lenses.forward import brown_conrady_coefficients as coefficients
from calib.lenses.forward import distort, lens_parts, undistort_step
from calib.lenses.lens import LensModel

#: Smallest cosine of incidence at which the distance is extrapolated along the tangent plane to the pixel's centre.
MIN_COSINE = 0.2


def sampler(lens: LensModel) -> Callable[..., None]:
    """Kernel for a lens model; all kernels take the same arguments, and this one writes no steps."""
    return composed(_sample, **lens_parts(lens))


def stepping_sampler(lens: LensModel) -> Callable[..., None]:
    """The kernel that also writes the steps from the vertices to the centres of their pixels."""
    return composed(_sample, write_step=_write_step, **lens_parts(lens))


@kernel
def write_step(steps: NDArray[np.float32], k: int, v: int, right: np.float32, down: np.float32) -> None:
    """Writes nothing, for depth; `composed` replaces it for pictures."""


@kernel
def _write_step(steps: NDArray[np.float32], k: int, v: int, right: np.float32, down: np.float32) -> None:
    """Writes the step of vertex v of candidate k."""
    steps[0, k, v], steps[1, k, v] = right, down


@kernel
def _sample(
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
    hidden: NDArray[np.bool_],
    optics: Optics,
    pixel: NDArray[np.int32],
    distance: NDArray[np.float32],
    steps: NDArray[np.float32],
) -> None:
    """Eqs. 10, 11 and 20 for a population; as in `SparseView` and `Synthesis`.

    A pixel's line of sight d, which differs from the vertex's by Δ, meets the tangent plane at z (1 − n · Δ / (n · d)).
    The steps (2, population, n) from a vertex to the centre of its pixel, right and down [px], are 0 where it has none.
    """
    zero, half, one = np.float32(0), np.float32(0.5), np.float32(1)
    (fx, fy, cx, cy), own_lens, pose = optics.matrix, coefficients(optics.lens), optics.pose
    stride = optics.width + 2
    per_fx, per_fy, flattest = one / fx, one / fy, np.float32(-MIN_COSINE)
    columns, rows, farthest = np.float32(optics.width), np.float32(optics.height), np.float32(optics.limit)
    for k in prange(vertices.shape[0]):
        for v in range(vertices.shape[2]):
            a, b, c = vertices[k, 0, v], vertices[k, 1, v], vertices[k, 2, v]
            x = pose[0, 0] * a + pose[0, 1] * b + pose[0, 2] * c + pose[0, 3]
            y = pose[1, 0] * a + pose[1, 1] * b + pose[1, 2] * c + pose[1, 3]
            z = pose[2, 0] * a + pose[2, 1] * b + pose[2, 2] * c + pose[2, 3]
            a, b, c = normals[k, 0, v], normals[k, 1, v], normals[k, 2, v]
            nx = pose[0, 0] * a + pose[0, 1] * b + pose[0, 2] * c
            ny = pose[1, 0] * a + pose[1, 1] * b + pose[1, 2] * c
            nz = pose[2, 0] * a + pose[2, 1] * b + pose[2, 2] * c
            inverse = one / z
            u, w = x * inverse, y * inverse
            r2 = u * u + w * w
            facing = nx * x + ny * y + nz * z < 0
            bent_u, bent_w = distort(u, w, own_lens)
            column = fx * bent_u + cx + half
            row = fy * bent_w + cy + half
            inside = column >= 0 and column < columns and row >= 0 and row < rows
            seen = facing and z > np.float32(1e-6) and r2 < farthest and inside
            place = (np.int32(row) + 1) * stride + np.int32(column) + 1 if seen else 0
            pixel[k, v] = -1 if hidden[v] else place
            right = np.float32(np.int32(column)) + half - column if seen else zero
            down = np.float32(np.int32(row)) + half - row if seen else zero
            write_step(steps, k, v, right, down)
            right, down = undistort_step(u, w, right * per_fx, down * per_fy, own_lens)
            u, w = u + right, w + down
            length = np.sqrt(u * u + w * w + one)
            along = min(nx * u + ny * w + nz, flattest * length)
            distance[k, v] = abs(z) * length * (one - (nx * right + ny * down) / along)
