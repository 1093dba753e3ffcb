"""How kernels collect a surface before they write it: a few vertices at a time, in rows a constant distance apart."""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel

#: Vertices whose results are collected before they are written: few enough to stay in the fastest cache. A constant,
#: so that the compiler knows how far apart the rows of results are and need not fear that they overlap.
TILE = 256

#: Vertices are computed so many at once; what a vertex is made from goes on so far beyond the last one.
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
        first: vertex that the tile begins with.
        count: number of its vertices.
        vertices, normals: of the whole surface (3, n).
    """
    for i in range(3):
        of_vertices, of_normals = vertices[i, first:], normals[i, first:]
        for v in range(np.uintp(count)):  # twice as fast as the assignment of slices
            of_vertices[v] = result[i, v]
        for v in range(np.uintp(count)):
            of_normals[v] = result[3 + i, v]
