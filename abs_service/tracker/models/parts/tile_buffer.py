"""Buffer in which kernels collect a tile of vertices before it is written, with rows of constant stride."""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel

#: Vertices per tile: few enough for the L1 cache. A compile-time constant, so that the stride between rows is constant
#: and the compiler can exclude aliasing between them.
TILE = 256

#: Vertices computed at once (SIMD width); per-vertex inputs are padded by this number.
LANES = 8


@kernel
def write(
    result: NDArray[np.float32],
    first: int,
    count: int,
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
) -> None:
    """Writes a tile.

    Args:
        result: x, y, z of the vertices and of their normals, in the first six rows (…, at least count).
        first: index of the tile's first vertex.
        count: number of its vertices.
        vertices, normals: those of the whole surface (3, n).
    """
    for i in range(3):
        of_vertices, of_normals = vertices[i, first:], normals[i, first:]
        for v in range(np.uintp(count)):  # twice as fast as assigning slices
            of_vertices[v] = result[i, v]
        for v in range(np.uintp(count)):
            of_normals[v] = result[3 + i, v]
