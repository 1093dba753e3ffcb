"""Points of a depth image in the image of another camera (eq. 10)."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.jit import kernel
from calib.lenses.forward import projector

#: Minimum z of a visible point [m].
_MIN_Z_M = 1e-3


class Source(NamedTuple):
    """The arrays of `Points`, as kernels take them."""

    place: NDArray[np.float32]
    inverse_z: NDArray[np.float32]
    distance: NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Points measured by a source, as seen by the target; arrays have the source's height and width.

    Attributes:
        distance: measured radial distances (h, w) [m], NaN without return.
        place: pixel coordinates in the target (h, w, 2) [px].
        inverse_z: 1/z in the target (h, w) [1/m], NaN if not visible.
    """

    distance: NDArray[np.float32]
    place: NDArray[np.float32]
    inverse_z: NDArray[np.float32]

    @property
    def source(self) -> Source:
        """The arguments of kernels."""
        return Source(self.place, self.inverse_z, self.distance)


class Geometry:
    """Two cameras, with everything precomputed that does not depend on measurements.

    Attributes:
        source, target: the cameras.
        rays: viewing directions of the source's pixels in the target's frame (h, w, 3).
        shift: source's centre in the target's frame (3,) [m].
    """

    def __init__(self, source: Camera, target: Camera):
        T_ts = target.T_sr @ source.T_rs
        self.source, self.target = source, target
        self.rays = (source.lookup.rays @ T_ts[:3, :3].T).astype(np.float32)
        self.shift = T_ts[:3, 3].astype(np.float32)
        self._matrix = np.array([target.fx, target.fy, target.cx, target.cy], np.float32)
        self._lens = target.lens.coefficients.astype(np.float32)
        self._limit = np.inf if target.lens.is_pinhole else target.field_radius**2
        self._to_pixels = projector(target.lens)

    def see(self, distance: NDArray[np.floating]) -> Points:
        """Points of radial distances (h, w) [m] of the source."""
        measured = np.ascontiguousarray(distance, np.float32)
        place = np.empty((*measured.shape, 2), np.float32)
        inverse_z = np.empty(measured.shape, np.float32)
        _see(measured, self.rays, self.shift, self._limit, place, inverse_z)
        self._to_pixels(place, self._matrix, self._lens)
        return Points(measured, place, inverse_z)


def bands(height: int, count: int) -> Sequence[tuple[int, int]]:
    """Divides a height into bands of rows (first, last + 1) for concurrent processing."""
    edges = np.linspace(0, height, count + 1).round().astype(int).tolist()
    return list(itertools.pairwise(edges))


@kernel
def _see(
    distance: NDArray[np.float32],
    rays: NDArray[np.float32],
    shift: NDArray[np.float32],
    limit: float,
    ideal: NDArray[np.float32],
    inverse_z: NDArray[np.float32],
) -> None:
    """Ideal coordinates and 1/z of points along rays from `shift`; points beyond the limit of r² are invalid."""
    zero, one, farthest = np.float32(0), np.float32(1), np.float32(limit)
    for r in range(distance.shape[0]):
        for c in range(distance.shape[1]):
            x = distance[r, c] * rays[r, c, 0] + shift[0]
            y = distance[r, c] * rays[r, c, 1] + shift[1]
            z = distance[r, c] * rays[r, c, 2] + shift[2]
            inverse = one / z
            u, w = x * inverse, y * inverse
            seen = z > np.float32(_MIN_Z_M) and u * u + w * w < farthest
            ideal[r, c, 0] = u if seen else zero
            ideal[r, c, 1] = w if seen else zero
            inverse_z[r, c] = inverse if seen else np.float32(np.nan)
