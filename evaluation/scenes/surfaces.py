"""Surfaces of known shape: dense grids of points with what they look like."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

#: Half of the light comes back, from everywhere.
GREY = np.full((2, 2), 0.5)


@dataclass(frozen=True, slots=True, eq=False)
class Sheet:
    """A surface over the unit square, sampled so densely that a camera cannot tell.

    Attributes:
        points: positions (rows, columns, 3) [m] in rig coordinates; the outermost ones are the rim. Their spacing in
            the image should be at most 0.7 sub-pixels.
        reflectivity: share of the light that comes back, 0…1, (h, w) of any size from 2 × 2 on: its corners are the
            sheet's, between its values it is linear.
        color: red, green, blue in 0…255 (h, w, 3), likewise.
    """

    points: NDArray[np.float64]
    reflectivity: NDArray[np.float64] = field(default_factory=lambda: GREY)
    color: NDArray[np.float64] = field(default_factory=lambda: np.repeat(255 * GREY[..., None], 3, axis=2))


@dataclass(frozen=True, slots=True)
class Wall:
    """A plane z = depth of the rig that fills whatever the sheets leave free.

    Attributes:
        depth: [m].
        reflectivity: share of the light that comes back, 0…1; 0 for a sensor that sees nothing there.
        color: red, green, blue in 0…255.
    """

    depth: float = 2.0
    reflectivity: float = 0.5
    color: tuple[float, float, float] = (90.0, 90.0, 90.0)


#: Nothing is behind the sheets.
NO_WALL = Wall(100.0, 0.0, (0.0, 0.0, 0.0))


class SplineSurface:
    """A tensor-product B-spline surface, which is a NURBS surface whose weights are all 1; knots equidistant, clamped.

    Args:
        shape: control points along u and w.
        degree: in both directions.
        u, w: parameters in [0, 1] at which points are wanted, (rows,) and (columns,).
    """

    def __init__(self, shape: tuple[int, int], degree: int, u: NDArray[np.floating], w: NDArray[np.floating]):
        self._along_u, self._along_w = (
            BSpline.design_matrix(np.asarray(at, float), knots(count, degree), degree).toarray()
            for at, count in zip((u, w), shape)
        )

    def points(self, control: NDArray[np.floating]) -> NDArray[np.float64]:
        """Points (rows, columns, 3) of control points (i, j, 3)."""
        i, j, axes = control.shape
        rows = (self._along_u @ control.reshape(i, j * axes)).reshape(-1, j, axes)
        return np.matmul(self._along_w, rows)

    def fit(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """The control points (i, j, 3) whose surface comes closest to points (rows, columns, 3), by least squares."""
        rows = np.tensordot(np.linalg.pinv(self._along_u), points, axes=(1, 0))
        return np.swapaxes(np.tensordot(np.linalg.pinv(self._along_w), rows, axes=(1, 1)), 0, 1)


def knots(count: int, degree: int) -> NDArray[np.float64]:
    """Equidistant knots in [0, 1] for so many control points, clamped at both ends."""
    return np.concatenate([np.zeros(degree), np.linspace(0, 1, count - degree + 1), np.ones(degree)])
