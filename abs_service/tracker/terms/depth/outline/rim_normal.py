"""Normals of an outline at the edges of a mesh, without what pixels make of them.

An edge tells where it is across the outline, nothing of where it is along it. But the gradients of distances from an
outline of pixels are up to 20° off its normal, and the squares of these errors add up: the two long edges of a board
whose ends are out of the image would hold it along itself to a millimetre. So the direction of the outline is that of
the mesh, which several edges tell together.
"""

import numpy as np
from numpy.typing import NDArray

#: So many edges, the edge included, tell the direction of the outline at one of them; or fewer that face as it does.
_EDGES, _FEWEST = 7, 3

#: Edges of one side of the mesh: smallest cosine between their directions, more than at a corner. Those of a hexagonal
#: grid point by up to 30° to the left or to the right of the normal.
_FACING = 0.4


def across_rim(
    gradients: NDArray[np.float64], places: NDArray[np.floating], directions: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Image gradients (k, 2) of distances from the outline at edges, without their component along the mesh's rim.

    Args:
        gradients: of the distances (k, 2).
        places: of the edges in the image (k, 2) [px].
        directions: out of the mesh, in the image (k, 2).
    """
    if len(places) < _FEWEST:
        return gradients
    units = directions / np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), np.finfo(float).tiny)
    apart = np.linalg.norm(places[:, None] - places, axis=2)
    apart[units @ units.T < _FACING] = np.inf
    nearest = np.argsort(apart, axis=1, kind="stable")[:, :_EDGES]
    alike = np.isfinite(np.take_along_axis(apart, nearest, axis=1))[..., None]
    count = np.maximum(alike.sum(axis=1, keepdims=True), 1)
    around = places[nearest].astype(np.float64)
    arms = np.where(alike, around - np.where(alike, around, 0.0).sum(axis=1, keepdims=True) / count, 0.0)
    along = np.linalg.eigh(arms.transpose(0, 2, 1) @ arms)[1][:, :, 1]
    rest = gradients - np.vecdot(gradients, along)[:, None] * along
    return np.where(count[:, 0] >= _FEWEST, rest, gradients)
