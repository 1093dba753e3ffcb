"""Reference of a target's true distances, which limits what can be learnt about a sensor."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from calib.noise.base import DepthNoise, NoiseError, pixels_where
from calib.sequences import plane
from calib.sequences.static import Static
from calib.sequences.static_board import StaticBoard

#: Tolerance of a pixel's mean about its plane: in its own deviations, and relative to its distance.
_DEVIATIONS, _SHARE = 3.0, 0.008


class Kind(StrEnum):
    """Source of true distances."""

    KNOWN = "known distance"  # all error components
    BOARD = "board pose"  # all error components, up to the uncertainty of the board's pose
    PLANE = "fitted plane"  # all but a mean offset that is common to the plane or affine in it
    MEAN = "temporal mean"  # temporal noise only

    @property
    def tells_offset(self) -> bool:
        """True if the mean offset of all pixels is observable."""
        return self in (Kind.KNOWN, Kind.BOARD)

    @property
    def has_target(self) -> bool:
        """True if a pixel's own error can be separated from the scene."""
        return self is not Kind.MEAN


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """True distances of one sequence.

    Attributes:
        kind: source of the distances.
        distance: radial (height, width) [m]; NaN where unknown.
        plane: q (3,) [1/m] of the target, q · X = 1 in the sensor's frame; zeros without one.
    """

    kind: Kind
    distance: NDArray[np.float64]
    plane: NDArray[np.float64]


def known(static: Static, depth: float, region: NDArray[np.bool_], generator: np.random.Generator) -> Reference:
    """Planar target at a known depth on the optical axis [m], with fitted orientation.

    Args:
        static: the sequence.
        depth: depth of the target on the optical axis [m].
        region: candidate pixels (height, width); the largest plane in them is used.
        generator: see `plane.find`.

    Raises:
        NoiseError: there is no plane.
    """
    tolerance = _tolerance(static)
    try:
        _, pixels = plane.find(static.mean, static.rays, static.still & region, tolerance, generator)
    except NoiseError as error:
        raise NoiseError(f"{static.name}: {error}; {static.moving:.0%} of its pixels moved") from error
    q = plane.through(depth, static.mean[pixels], static.rays[pixels], tolerance[pixels])
    return _of(Kind.KNOWN, q, static, pixels)


def subtract_mean_offset(reference: Reference, static: Static, model: DepthNoise) -> Reference:
    """Refits the orientation of a target at a known distance after subtracting a model's mean offsets."""
    pixels = np.isfinite(reference.distance)
    x, a, p = reference.distance[pixels], static.brightness[pixels], pixels_where(pixels)
    offset = model.mean(x, a, p)
    depth = 1 / float(reference.plane[2])
    q = plane.through(depth, static.mean[pixels] - offset, static.rays[pixels], _tolerance(static)[pixels])
    return _of(Kind.KNOWN, q, static, pixels)


def on_board(static: Static, board: StaticBoard, region: NDArray[np.bool_]) -> Reference:
    """Board with a pose from its corners.

    Args:
        static: the sequence.
        board: its pose.
        region: candidate pixels (height, width); those on the board and not occluded are used.

    Raises:
        NoiseError: no static pixel on the board.
    """
    pixels = static.still & region & board.inside
    off = static.mean - plane.radial(board.plane, static.rays)
    if not pixels.any():
        raise NoiseError(f"{static.name}: no distance on the board is static")
    pixels &= np.abs(off - np.median(off[pixels])) < _tolerance(static)
    return _of(Kind.BOARD, board.plane, static, pixels)


def fitted(static: Static, region: NDArray[np.bool_], generator: np.random.Generator) -> Reference:
    """Largest plane in a region, fitted to the sensor's own distances.

    Raises:
        NoiseError: there is no plane.
    """
    q, pixels = plane.find(static.mean, static.rays, static.still & region, _tolerance(static), generator)
    return _of(Kind.PLANE, q, static, pixels)


def mean(static: Static, region: NDArray[np.bool_], generator: np.random.Generator) -> Reference:
    """Temporal mean of each pixel.

    If noise is smaller than the quantisation step, a pixel may repeat one value although it errs by up to half a step.
    That part of the error is simulated: uniform, with the variance that temporal noise does not show.

    Args:
        static: the sequence.
        region: candidate pixels (height, width).
        generator: draws the quantisation errors.
    """
    where = static.still & region
    if not where.any():
        raise NoiseError(f"{static.name}: nothing in the region is static")
    step = static.steps.at(np.nan_to_num(static.mean))
    hidden = np.sqrt(np.clip(1 - 12 * static.variance / np.square(np.maximum(step, 1e-9)), 0, 1))
    dither = step * hidden * generator.uniform(-0.5, 0.5, step.shape)
    return Reference(Kind.MEAN, np.where(where, static.mean + dither, np.nan), np.zeros(3))


def _tolerance(static: Static) -> NDArray[np.float64]:
    wide = _DEVIATIONS * np.sqrt(static.variance) + static.steps.at(static.mean) / 2 + _SHARE * static.mean
    return np.where(static.still, wide, 1.0)


def _of(kind: Kind, q: NDArray[np.float64], static: Static, pixels: NDArray[np.bool_]) -> Reference:
    return Reference(kind, np.where(pixels, plane.radial(q, static.rays), np.nan), q)
