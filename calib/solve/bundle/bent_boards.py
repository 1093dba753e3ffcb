"""Errors of the parameters by a board that is not flat, which no scatter of the views shows, as all views share them.

A bend of some tenths of a millimetre is explained by other focal lengths and another lens. More poses make what they
disagree by smaller, and not that: of 30 simulated cameras each, with 6 to 12 poses of a board of 24 cm that was bent by
0.3 mm, focal lengths were 1.1 to 2.7 times as wrong as ± said without it.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from calib.solve.bundle.additional_parameters import further
from calib.solve.bundle.blocks import Corners
from calib.solve.bundle.equations import Equations

#: Powers of x and y of the bends: along both sides, and twisted.
_POWERS = ((2, 0), (1, 1), (0, 2))

#: Squared deviations by which the surest of the bends of a flat board differs from 0.
_CHANCE = 4.0

#: Size of the bends that columns of the equations stand for [m].
_BEND_M = 1e-3


def bend_covariance(equations: Equations, residuals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance (k, k) of the sensors' parameters by the bend that the corners ask for; 0 where chance explains it.

    The bend is taken for an error that may have either sign, less what would be found of a flat board (James and
    Stein).

    Args:
        equations: at their minimum.
        residuals: normalised, there (n,).
    """
    count = equations.layout.board_start
    columns = shape_columns(equations, equations.base_jacobian, _bends)
    found = [
        (float(one.sizes.item() / one.sigmas.item()) ** 2, one.changes[:count])
        for one in further(equations, residuals, [column[:, None] for column in columns.T])
        if one.sigmas.item() > 0  # of boards between two shots, or without corners, there is no estimate
    ]
    certain, change = max(found, key=lambda each: each[0], default=(0.0, np.zeros(count)))
    return max(0.0, 1 - _CHANCE / max(certain, _CHANCE)) * np.outer(change, change)


def shape_columns(
    equations: Equations,
    jacobian: sparse.csr_array,
    displacements: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Derivatives of the residuals with respect to displacements of the board's points (n, m).

    Args:
        equations: see there.
        jacobian: of the equations.
        displacements: of points of the board (k, 3) in its frame (k, m, 3) [m].
    """
    turns = np.stack([equations.base.boards[shot][:3, :3] for shot in equations.layout.shots])
    found = np.zeros((int(equations.ends[-1]), displacements(np.zeros((1, 3))).shape[1]))
    for each in by_places(equations, jacobian):
        displaced = np.repeat(displacements(each.corners.points_b), 2, axis=0)
        found[each.rows] = np.einsum("ni,nij,nkj->nk", each.by_place, turns[each.shots], displaced)
    return found


class ByPlaces(NamedTuple):
    """Corners of a sensor, and what their residuals do if points of the board are elsewhere.

    Attributes:
        sensor: its name.
        corners: of its views.
        rows: of their residuals.
        shots: row of the shot of each residual (n,).
        by_place: derivatives of the residuals with respect to the places of the points in the rig (n, 3) [1/m].
    """

    sensor: str
    corners: Corners
    rows: slice
    shots: NDArray[np.intp]
    by_place: NDArray[np.float64]


def by_places(equations: Equations, jacobian: sparse.csr_array) -> Iterator[ByPlaces]:
    """Corners of each sensor; without those of boards between two shots."""
    by_rows = sparse.csr_matrix(jacobian)
    for group, rows in zip(equations.groups, equations.slices(), strict=True):
        if isinstance(group.measured, Corners) and group.shots.ndim == 1:
            shots = group.shots[group.views_of_rows]
            starts, every = equations.layout.board_start + 6 * shots + 3, np.arange(rows.start, rows.stop)
            places = np.stack([np.asarray(by_rows[every, starts + axis]).ravel() for axis in range(3)], axis=1)
            yield ByPlaces(group.sensor, group.measured, rows, shots, places)


def _bends(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacements of points of the board (n, 3) in its frame, for each bend (n, 3, 3) [m]."""
    return curves(points, _POWERS)[:, :, None] * np.eye(3)[2]


def curves(points: NDArray[np.float64], powers: Sequence[tuple[int, int]]) -> NDArray[np.float64]:
    """Displacements of points of the board (n, 3) by powers of x and y, 1 mm at its edge (n, m) [m]."""
    low, high = points.min(axis=0), points.max(axis=0)
    x, y, _ = ((points - (low + high) / 2) / max((high - low).max() / 2, 1e-12)).T
    return _BEND_M * np.stack([x**a * y**b for a, b in powers], axis=1)
