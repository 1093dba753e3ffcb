"""Lookup table of one camera: ideal viewing direction of every pixel, computed once by inverting the distortion."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.lenses.lens import LensError, LensModel

#: Largest error of the inverse at a pixel centre [px].
ACCURACY_PX = 1e-3

#: Image rows that are inverted together.
_ROWS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Lookup:
    """Ideal normalised coordinates (x/z, y/z) of the centres of all pixels.

    Attributes:
        ideal: shape (height, width, 2); cannot be written to.
    """

    ideal: NDArray[np.float64]

    @property
    def ray_length(self) -> NDArray[np.float64]:
        """Ratio of radial distance to z of every pixel (height, width)."""
        return np.sqrt(1 + _squared_length(self.ideal))

    @property
    def rays(self) -> NDArray[np.float64]:
        """Unit viewing direction of every pixel in sensor coordinates (height, width, 3)."""
        directions = np.concatenate([self.ideal, np.ones((*self.ideal.shape[:2], 1))], axis=-1)
        return directions / self.ray_length[..., None]

    @property
    def radius(self) -> float:
        """Largest distance of a pixel from the optical axis, in normalised coordinates."""
        return float(np.sqrt(_squared_length(self.ideal).max()))


def build(size: tuple[int, int], matrix: tuple[float, float, float, float], lens: LensModel) -> Lookup:
    """Lookup table of an image of size (width, height) with camera matrix (fx, fy, cx, cy) [px].

    Raises:
        LensError: the inverse is missing or less accurate than `ACCURACY_PX` at some pixel; names the pixel and the
            radius from which on it fails.
    """
    focal, center = np.array(matrix[:2]), np.array(matrix[2:])
    pixels = np.stack(np.meshgrid(*(np.arange(length, dtype=float) for length in size)), axis=-1)
    ideal, error = np.empty_like(pixels), np.empty(pixels.shape[:2])  # squared, [px²]
    for rows in np.array_split(np.arange(size[1]), -(-size[1] // _ROWS)):  # blocks that fit into the cache
        ideal[rows] = lens.inverse((pixels[rows] - center) / focal)
        error[rows] = _squared_length(lens.distort(ideal[rows]) * focal + center - pixels[rows])
    wrong = ~(error <= ACCURACY_PX**2)
    if wrong.any():
        raise LensError(_complaint(lens, wrong, np.linalg.norm(pixels - center, axis=-1)))
    ideal.setflags(write=False)
    return Lookup(ideal)


def _squared_length(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Squared lengths (…) of places (…, 2); five times faster than a norm along so short an axis."""
    return places[..., 0] ** 2 + places[..., 1] ** 2


def _complaint(lens: LensModel, wrong: NDArray[np.bool_], radius: NDArray[np.float64]) -> str:
    """Error message for pixels (height, width) without an inverse; `radius` is from the principal point [px]."""
    row, column = np.unravel_index(np.argmin(np.where(wrong, radius, np.inf)), wrong.shape)
    return (
        f"the {lens.name} distortion {lens.coefficients.tolist()} has no inverse to {ACCURACY_PX} px at "
        f"{np.count_nonzero(wrong)} of {wrong.size} pixels, the innermost at (column, row) = ({column}, {row}): "
        f"from a radius of {radius[row, column]:.1f} px around the principal point on no light can have come through it"
    )
