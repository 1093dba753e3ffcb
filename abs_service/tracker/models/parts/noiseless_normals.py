"""Normals of a mesh without the noise of the image that it was made from.

A surface without relief slides along itself unseen. But noise of the mesh looks like relief, and so it seems to hold
the mesh, the better the more noise there is. Normals are therefore those of a smooth surface, and of the relief beyond
it only as much as is more than noise.
"""

from dataclasses import replace

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh, mean_around, unit

#: Times that every normal is replaced by the mean with its neighbours: what is smooth reaches over some five edges.
ROUNDS = 30
#: Draws of the noise, from which its share in the relief is known to a few per cent …
DRAWS = 8
#: … and factor on it that is taken away.
EXCESS = 1.15


def noiseless_normals(mesh: Mesh) -> NDArray[np.float64]:
    """Unit normals (n, 3) of a mesh, those of its vertices if they have no deviation.

    The mean square of the relief by noise is found from draws of it.
    """
    normals = mesh.normals
    if not np.any(mesh.deviation):
        return normals
    mean = mean_around(mesh)
    smooth, relief = _parted(normals, mean)
    noise = [_parted(drawn, mean)[1] - relief for drawn in _drawn(mesh, normals)]
    share = 1 - EXCESS * np.mean(np.square(noise)) / max(np.mean(relief**2), np.finfo(float).tiny)
    return unit(smooth + np.sqrt(max(share, 0.0)) * relief)


def _drawn(mesh: Mesh, normals: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Normals of the mesh with its noise once more."""
    steps = mesh.deviation * np.random.default_rng(0).standard_normal((DRAWS, len(normals)))
    return [replace(mesh, vertices=mesh.vertices + step[:, None] * normals).normals for step in steps]


def _parted(
    normals: NDArray[np.float64], mean: "scipy.sparse.csr_array"
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Smooth part (n, 3) of normals, of unit length, and the rest."""
    smooth = normals
    for _ in range(ROUNDS):
        smooth = mean @ smooth
    smooth = unit(smooth)
    return smooth, normals - smooth
