"""Difference of two calibrations of one camera, as projections.

Parameters of two lens models cannot be compared, and a shifted principal point is nearly a rotation of the camera. So
the small rigid motion of the camera that best makes one calibration of the other is subtracted, as for uncertainties
(the implied transformation of J. Chen's mrcal).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.camera import Camera
from calib.solve.bundle.parameters.lens_parameters import MATRIX, kind_of
from calib.solve.validation.projection_uncertainty import MotionCompensation, grid, viewing_directions
from calib.solve.validation.support import in_hull

#: Distances at which the motion is determined, in parts of the one that is asked for.
VOLUME = (0.6, 1.0, 1.4)

#: Number of cameras that are drawn from a covariance, and share of them that differ by less than chance.
_DRAWS, _CHANCE = 100, 0.95


class DifferenceError(ValueError):
    """Calibrations that are not of the same images, or share no part of the image."""


@dataclass(frozen=True)
class DifferenceMap:
    """Differences of two projections over an image.

    Attributes:
        pixels: grid points (rows, columns, 2) [px].
        differences: distances of the projections (rows, columns) [px]; NaN where one of the lenses has no inverse.
        inside: True where boards were seen (rows, columns), or everywhere if that is unknown.
    """

    pixels: NDArray[np.float64]
    differences: NDArray[np.float64]
    inside: NDArray[np.bool_]

    def summary(self, where: NDArray[np.bool_]) -> tuple[float, float, tuple[float, float]] | None:
        """Median, largest [px] and place (column, row) of the largest difference of grid points; None without any."""
        usable = where & np.isfinite(self.differences)
        if not usable.any():
            return None
        values, places = self.differences[usable], self.pixels[usable]
        column, row = places[np.argmax(values)].tolist()
        return float(np.median(values)), float(values.max()), (column, row)


def projection_difference(
    one: Camera, other: Camera, distance: float, corners: NDArray[np.floating] | None = None
) -> DifferenceMap:
    """Difference of two calibrations of the same images.

    Args:
        one, other: the calibrations; poses do not count.
        distance: of the points that are projected [m].
        corners: pixels (n, 2) of boards, in whose hull the motion is determined; None for the whole image.

    Raises:
        DifferenceError: the images have different sizes, or no point is projected by both.
    """
    if (one.width, one.height) != (other.width, other.height):
        sizes = [f"{camera.width} × {camera.height}" for camera in (one, other)]
        raise DifferenceError(f"one is of images of {sizes[0]} pixels, the other of {sizes[1]}")
    one, other = (replace(camera, T_rs=pose.identity()) for camera in (one, other))
    pixels = grid(one)
    flat = pixels.reshape(-1, 2)
    inside = np.ones(len(flat), np.bool_) if corners is None else in_hull(corners, flat)
    rays = viewing_directions(one, flat)
    changes, volume, in_volume = _changes(one, other, flat, rays * distance), [], []
    usable = inside & np.isfinite(changes).all(axis=1)
    if np.count_nonzero(usable) < 6:
        raise DifferenceError("there is hardly a point that both project")
    for part in VOLUME:
        volume.append(rays[usable] * part * distance)
        in_volume.append(_changes(one, other, flat[usable], volume[-1]))
    compensation = MotionCompensation(one, np.concatenate(volume))
    known = np.isfinite(changes).all(axis=1)
    left = compensation.at(rays[known] * distance, np.concatenate(in_volume)[..., None], changes[known][..., None])
    differences = np.full(len(flat), np.nan)
    differences[known] = np.linalg.norm(left[..., 0], axis=1)
    return DifferenceMap(pixels, differences.reshape(pixels.shape[:2]), inside.reshape(pixels.shape[:2]))


def _changes(
    one: Camera, other: Camera, pixels: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Other's projections (n, 2) of points (n, 3) that one has at these pixels, minus those; NaN beyond its field."""
    found = other.project(points) - pixels
    with np.errstate(invalid="ignore"):
        found[~(np.linalg.norm(found, axis=1) < max(one.width, one.height) / 2)] = np.nan
    return found


def chance(
    camera: Camera,
    names: Sequence[str],
    covariance: NDArray[np.float64],
    distance: float,
    corners: NDArray[np.floating] | None = None,
) -> NDArray[np.float64]:
    """Differences (rows, columns) [px] that 95 % of the calibrations stay below that are as uncertain as this one.

    Args:
        camera: the calibration.
        names, covariance: of its estimated parameters (n,), (n, n); others than intrinsics are ignored.
        distance, corners: as of `projection_difference`.
    """
    own = [k for k, name in enumerate(names) if name in kind_of(camera.lens).fixable]
    values, vectors = np.linalg.eigh(covariance[np.ix_(own, own)])
    names = [names[k] for k in own]
    root, generator = vectors * np.sqrt(np.maximum(values, 0)), np.random.default_rng(0)
    drawn = [
        projection_difference(
            camera, _moved(camera, dict(zip(names, root @ generator.standard_normal(len(names))))), distance, corners
        ).differences
        for _ in range(_DRAWS)
    ]
    return np.quantile(np.nan_to_num(drawn, nan=np.inf), _CHANCE, axis=0, method="higher")  # inf minus inf is none


def _moved(camera: Camera, steps: Mapping[str, float]) -> Camera:
    """Camera with other intrinsics; a focal length fy that was not estimated stays in its ratio to fx."""
    kind = kind_of(camera.lens)
    lens = kind.make(np.array([value + steps.get(k, 0.0) for k, value in zip(kind.every, camera.lens.coefficients)]))
    matrix = {name: getattr(camera, name) + steps.get(name, 0.0) for name in MATRIX}
    if "fy" not in steps:
        matrix["fy"] = camera.fy * matrix["fx"] / camera.fx
    return replace(camera, lens=lens, **matrix)
