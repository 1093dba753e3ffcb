"""What a target's real distances are taken to be, and so what can be learnt of a sensor from it."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from calib.noise.base import DepthNoise, NoiseError, pixels_where
from calib.sequences import plane
from calib.sequences.placed import Placed
from calib.sequences.static import Static

#: How far a pixel's mean may be from its plane: so many of its own deviations, and so much of its distance.
_DEVIATIONS, _SHARE = 3.0, 0.008


class Kind(StrEnum):
    """Where real distances come from."""

    KNOWN = "known distance"  # everything can be told
    BOARD = "board pose"  # likewise, as well as the board's corners tell its pose
    PLANE = "fitted plane"  # all but a mean offset that is common to a plane, or makes one of it
    MEAN = "temporal mean"  # only how distances scatter in time

    @property
    def tells_offset(self) -> bool:
        """Whether the mean offset of all pixels can be told."""
        return self in (Kind.KNOWN, Kind.BOARD)


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """Real distances of one sequence.

    Attributes:
        kind: where they come from.
        distance: radial (height, width) [m]; NaN where none is known.
        plane: q (3,) [1/m] of the target, q · X = 1 in the sensor's frame; zeros without one.
    """

    kind: Kind
    distance: NDArray[np.float64]
    plane: NDArray[np.float64]


def known(static: Static, depth: float, region: NDArray[np.bool_], generator: np.random.Generator) -> Reference:
    """A flat target that meets the optical axis at a known depth [m]; how it is turned is fitted.

    Args:
        static: the sequence.
        depth: where the target meets the optical axis [m].
        region: pixels (height, width) that may show it; the largest plane in them is taken.
        generator: see `plane.find`.

    Raises:
        NoiseError: there is no plane.
    """
    tolerance = _tolerance(static)
    _, pixels = plane.find(static.mean, static.rays, static.still & region, tolerance, generator)
    q = plane.through(depth, static.mean[pixels], static.rays[pixels], tolerance[pixels])
    return _of(Kind.KNOWN, q, static, pixels)


def subtract_mean_offset(reference: Reference, static: Static, model: DepthNoise) -> Reference:
    """A known distance's target turned anew, with the mean offsets of the pixels removed that a model now tells."""
    pixels = np.isfinite(reference.distance)
    x, a, p = reference.distance[pixels], static.brightness[pixels], pixels_where(pixels)
    offset = model.mean(x, a, p)
    depth = 1 / float(reference.plane[2])
    q = plane.through(depth, static.mean[pixels] - offset, static.rays[pixels], _tolerance(static)[pixels])
    return _of(Kind.KNOWN, q, static, pixels)


def on_board(static: Static, board: Placed, region: NDArray[np.bool_]) -> Reference:
    """A board whose pose its corners told.

    Args:
        static: the sequence.
        board: where it is.
        region: pixels (height, width) that count; of these, those on the board are taken, without what stands before
            it.

    Raises:
        NoiseError: nothing of the board is static.
    """
    pixels = static.still & region & board.inside
    off = static.mean - plane.radial(board.plane, static.rays)
    if not pixels.any():
        raise NoiseError(f"{static.name}: no distance on the board is static")
    pixels &= np.abs(off - np.median(off[pixels])) < _tolerance(static)
    return _of(Kind.BOARD, board.plane, static, pixels)


def fitted(static: Static, region: NDArray[np.bool_], generator: np.random.Generator) -> Reference:
    """The largest plane in a region, where the sensor itself sees it.

    Raises:
        NoiseError: there is no plane.
    """
    q, pixels = plane.find(static.mean, static.rays, static.still & region, _tolerance(static), generator)
    return _of(Kind.PLANE, q, static, pixels)


def mean(static: Static, region: NDArray[np.bool_], generator: np.random.Generator) -> Reference:
    """What each pixel measured on average.

    Where the noise is smaller than the steps of the distances, a pixel may repeat one value for ever, though it errs by
    up to half a step. That part of the error is made up here: uniform, and as large as what does not show in time.

    Args:
        static: the sequence.
        region: pixels (height, width) that count.
        generator: draws the errors within a step.
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
