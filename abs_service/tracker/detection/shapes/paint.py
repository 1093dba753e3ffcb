"""Colours of a known surface between the points at which a file has them."""

from typing import Protocol

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

#: Number of points that a colour is interpolated from.
NEIGHBORS = 8

#: Opposite sides of a body count apart by this share of its size.
SIDES_APART = 0.05

#: Weight that keeps gradients finite where these points lie in a plane or on a line, as a share of their mean square.
RIDGE = 1e-3


class Paint(Protocol):
    """Colours of a surface in its own frame."""

    def at(self, points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float32]:
        """Red, green and blue (n, 3) in 0…255 at points (n, 3) [m] with unit normals (n, 3); NaN where unknown."""
        ...


class NoPaint:
    """A surface of unknown colours."""

    def at(self, points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float32]:
        """NaN (n, 3)."""
        return np.full((len(points), 3), np.nan, np.float32)


NO_PAINT = NoPaint()


class PointPaint:
    """Colours of single points; between them, a plane is fitted to the colours of the nearest ones (local regression).

    Args:
        points: (k, 3) [m].
        normals: unit normals (k, 3) of the surface there, which tell the sides of a thin body apart.
        colors: red, green, blue (k, 3) in 0…255.
    """

    def __init__(self, points: NDArray[np.float64], normals: NDArray[np.float64], colors: NDArray[np.float64]):
        self._apart = SIDES_APART * float(np.ptp(points, axis=0).max())
        self._tree = scipy.spatial.KDTree(np.hstack([points, self._apart * normals]))
        self._points, self._colors = points, colors

    def at(self, points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float32]:
        """See `Paint`; within the range of the nearest points' colours."""
        places = np.hstack([points, self._apart * normals])
        away, nearest = self._tree.query(places, min(NEIGHBORS, len(self._points)))
        reach = np.maximum(away[:, -1:], 1e-9)
        weight = (1 - (away / (1.01 * reach)) ** 2)[:, :, None]
        design = np.insert((self._points[nearest] - points[:, None]) / reach[:, :, None], 0, 1.0, axis=2)
        colors = self._colors[nearest]
        weighted = np.swapaxes(design * weight, 1, 2)
        ridge = RIDGE * np.diag([0.0, 1.0, 1.0, 1.0]) * weight.sum(axis=1, keepdims=True)
        fitted = np.linalg.solve(weighted @ design + ridge, weighted @ colors)[:, 0]
        return np.clip(fitted, colors.min(axis=1), colors.max(axis=1)).astype(np.float32)
