"""Points of a known surface."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Samples:
    """Points of a known surface in its own frame, in an order in which the first k are evenly spread for any k.

    Attributes:
        points: positions (n, 3) [m].
        normals: unit normals (n, 3), outwards if the surface is closed.
        area: of the surface [m²].
        is_closed: True for the surface of a body, which is seen from outside only; otherwise either side may be seen.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    area: float
    is_closed: bool

    @property
    def spacing(self) -> float:
        """Distance between neighbouring points [m]."""
        return float(np.sqrt(self.area / len(self.points)))

    def thinned(self, count: int) -> "Samples":
        """The first `count` of them."""
        return replace(self, points=self.points[:count], normals=self.normals[:count])


def farthest_first(points: NDArray[np.float64], count: int) -> NDArray[np.intp]:
    """Indices (k,) of evenly spread points among (n, d): each is the farthest from all before it (Gonzalez, 1985)."""
    # One column of memory for each coordinate: short rows are summed eight times as slowly.
    centred = np.ascontiguousarray((points - points.mean(axis=0)).T, np.float32)
    chosen = np.empty(min(count, len(points)), np.intp)
    away = np.full(len(points), np.inf, np.float32)
    following = int(np.argmax(np.sum(centred**2, axis=0)))
    for k in range(len(chosen)):
        chosen[k] = following
        np.minimum(away, np.sum((centred - centred[:, following, None]) ** 2, axis=0), out=away)
        following = int(np.argmax(away))
    return chosen
