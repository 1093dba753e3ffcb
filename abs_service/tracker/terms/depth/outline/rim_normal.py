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


def rim_directions(places: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit directions (k, 2) of the mesh's rim in the image at its edges; 0 where too few edges tell.

    Args:
        places: of the edges in the image (k, 2) [px].
        directions: out of the mesh, in the image (k, 2).
    """
    if len(places) < _FEWEST:
        return np.zeros_like(places)
    units = directions / np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), np.finfo(float).tiny)
    x, y = places.T
    apart = (x[:, None] - x) ** 2 + (y[:, None] - y) ** 2
    apart[units @ units.T < _FACING] = np.inf
    nearest = np.argsort(apart, axis=1, kind="stable")[:, :_EDGES]
    alike = np.isfinite(np.take_along_axis(apart, nearest, axis=1))
    count = alike.sum(axis=1)
    x, y = (_centred(part[nearest], alike, count) for part in (x, y))
    angles = np.arctan2(2 * np.vecdot(x, y), np.vecdot(x, x) - np.vecdot(y, y)) / 2  # of the longer principal axis
    return np.stack([np.cos(angles), np.sin(angles)], axis=1) * (count >= _FEWEST)[:, None]


def across_rim(gradients: NDArray[np.float64], along: NDArray[np.float64]) -> NDArray[np.float64]:
    """Image gradients (k, 2) of distances from the outline at edges, without their component along the rim (k, 2)."""
    return gradients - np.vecdot(gradients, along)[:, None] * along


def _centred(values: NDArray[np.float64], which: NDArray[np.bool_], count: NDArray[np.intp]) -> NDArray[np.float64]:
    """Values (k, n) minus the mean of those which count (k, n), of which there are (k,); 0 for the others."""
    means = np.where(which, values, 0.0).sum(axis=1) / np.maximum(count, 1)
    return np.where(which, values - means[:, None], 0.0)
