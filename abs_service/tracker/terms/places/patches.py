"""Patches of a mesh: vertices near one another, whose appearance is looked for together, and where it is found."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import SparseJacobian
from abs_service.tracker.synthesis.perspective import project_with_jacobian
from abs_service.tracker.terms.linearization import PointLinearization
from calib.camera import Camera

#: Number of vertices of a patch, about, and the largest number of patches.
SIZE, MAX_PATCHES = 30, 16

#: Standard deviation of a place that was found in the image [px].
SIGMA_PX = 0.5

#: Shifts of up to this are the same place [px]; gradients hold as far.
NEAR_PX = 2

#: Patch (n,) of every vertex, 0…
Patches = NDArray[np.intp]


def patches_of(mesh: Mesh) -> Patches:
    """Patch of every vertex (n,), 0…: of the nearest of some vertices that are far from one another."""
    vertices = mesh.vertices
    count = min(max(len(vertices) // SIZE, 1), MAX_PATCHES)
    away = np.linalg.norm(vertices - vertices.mean(axis=0), axis=1)
    result, center = np.zeros(len(vertices), np.intp), int(np.argmin(away))
    away[:] = np.inf
    for patch in range(count):  # the farthest point from those before
        own = np.linalg.norm(vertices - vertices[center], axis=1)
        result[own < away] = patch
        away = np.minimum(away, own)
        center = int(np.argmax(away))
    return result


def found_at(
    camera: Camera,
    points: NDArray[np.floating],
    which: NDArray[np.intp],
    shift: NDArray[np.float64],
    sparse_jacobian: SparseJacobian,
) -> PointLinearization:
    """Residuals of the places in an image, two for each of some points (n, 3), that are found shifted (k, 2) [px]."""
    rows = project_with_jacobian(camera, points[which].astype(np.float64))[1].reshape(-1, 3) / SIGMA_PX
    return PointLinearization(-shift.ravel() / SIGMA_PX, rows, np.repeat(which, 2), sparse_jacobian, points)


def is_beside(rows: Sequence[PointLinearization]) -> bool:
    """True if anything is found beside the mesh, further than gradients hold."""
    return any(len(part.residual) and np.abs(part.residual).max() * SIGMA_PX >= NEAR_PX for part in rows)
