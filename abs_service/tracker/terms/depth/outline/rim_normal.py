"""Normals of an outline at the edges of a mesh, without what pixels make of them.

An edge tells where it is across the outline, nothing of where it is along it. But the gradients of distances from an
outline of pixels are up to 20° off its normal, and the squares of these errors add up: the two long edges of a board
whose ends are out of the image would hold it along itself to a millimetre. So the direction of the outline is that of
the mesh, which several edges tell together.
"""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel

#: So many edges, the edge included, tell the direction of the outline at one of them; or fewer that face as it does.
EDGES, MIN_EDGES = 7, 3

#: Edges of one side of the mesh: smallest cosine between their directions, more than at a corner. Those of a hexagonal
#: grid point by up to 30° to the left or to the right of the normal.
FACING = 0.4


def rim_directions(places: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit directions (k, 2) of the mesh's rim in the image at its edges; 0 where too few edges tell.

    Args:
        places: of the edges in the image (k, 2) [px].
        directions: unit ones out of the mesh, in the image (k, 2).
    """
    along = np.empty_like(places)
    _rim_directions(places, directions, along)
    return along


def across_rim(gradients: NDArray[np.float64], along: NDArray[np.float64]) -> NDArray[np.float64]:
    """Image gradients (k, 2) of distances from the outline at edges, without their component along the rim (k, 2)."""
    return gradients - np.vecdot(gradients, along)[:, None] * along


@kernel
def _rim_directions(places: NDArray[np.float64], directions: NDArray[np.float64], along: NDArray[np.float64]) -> None:
    """Longer principal axes of the `EDGES` nearest edges that face as each does, into `along`; see `rim_directions`."""
    nearest, apart = np.empty(EDGES, np.int64), np.empty(EDGES)
    for k in range(places.shape[0]):
        count = 0
        for m in range(places.shape[0]):
            x, y = places[m, 0] - places[k, 0], places[m, 1] - places[k, 1]
            square, farthest = x * x + y * y, apart[EDGES - 1] if count == EDGES else np.inf
            faces = directions[k, 0] * directions[m, 0] + directions[k, 1] * directions[m, 1] >= FACING
            if not (faces and square < farthest):  # nor where a place is unknown
                continue
            count = min(count + 1, EDGES)
            at = count - 1
            while at > 0 and square < apart[at - 1]:
                nearest[at], apart[at] = nearest[at - 1], apart[at - 1]
                at -= 1
            nearest[at], apart[at] = m, square
        x, y, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0
        for m in nearest[:count]:
            x, y = x + (places[m, 0] - places[k, 0]) / count, y + (places[m, 1] - places[k, 1]) / count
        for m in nearest[:count]:
            from_x, from_y = places[m, 0] - places[k, 0] - x, places[m, 1] - places[k, 1] - y
            xx, xy, yy = xx + from_x * from_x, xy + from_x * from_y, yy + from_y * from_y
        angle, tells = np.arctan2(2 * xy, xx - yy) / 2, 1.0 if count >= MIN_EDGES else 0.0
        along[k, 0], along[k, 1] = tells * np.cos(angle), tells * np.sin(angle)
