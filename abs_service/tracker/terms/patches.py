"""Patches of a mesh: vertices near one another, whose appearance is looked for together."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh

#: Number of vertices of a patch, about, and the largest number of patches.
SIZE, MOST = 30, 16

#: Patch (n,) of every vertex, 0…
Patches = NDArray[np.intp]


def patches_of(mesh: Mesh) -> Patches:
    """Patch of every vertex (n,), 0…: of the nearest of some vertices that are far from one another."""
    vertices = mesh.vertices
    count = min(max(len(vertices) // SIZE, 1), MOST)
    away = np.linalg.norm(vertices - vertices.mean(axis=0), axis=1)
    result, center = np.zeros(len(vertices), np.intp), int(np.argmin(away))
    away[:] = np.inf
    for patch in range(count):  # the farthest point from those before
        own = np.linalg.norm(vertices - vertices[center], axis=1)
        result[own < away] = patch
        away = np.minimum(away, own)
        center = int(np.argmax(away))
    return result
